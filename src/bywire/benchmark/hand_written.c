/* The motorcycle brake and its ECU, written by hand: what an engineer would write for this one
 * brake and this one time-stepping scheme, and the yardstick for bywire's compiled kernels.
 *
 * Implicit midpoint with the midpoint predicted from the last increment, one dry friction
 * projected on the end-of-step speed, two end stops, and a chamber pressure that cannot fall
 * below zero. Everything but the shaft's row is eliminated on paper, see struct Held.
 *
 * It covers the default choices only: drive.mode pressure, gear.law paper, caliper.law linear,
 * no air, port.law makeup, a quantized converter, sine dither in front of the low-pass filter,
 * the sensor at the master cylinder.
 *
 * The line below is replaced by enums P_, X_, M_, U_, E_ and O_ of parameters, state, memory,
 * stimulus, energies and outputs, generated from the model (peers/hand_c.py). */
#include "hand_written_indices.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

static const double PI = 3.14159265358979323846;
enum { CAP = 8 };           /* passes of a substep whose contacts do not settle */
static const double FAR_DECAYED = 40.0; /* exp(-40) is far below the last digit of 1 */

/* What a run carries from call to call; all doubles, so that an array can hold it. */
typedef struct {
    double x[X_COUNT], d[X_COUNT]; /* state, half of the last increment */
    double m[M_COUNT], e[E_COUNT]; /* ECU memory, energies */
    double friction, makeup, near_stop, far_stop, unsettled, repeated;
} Saved;

/* Factors that depend on parameters and step only. */
typedef struct {
    const double *raw;
    double h, half;            /* step, half of it */
    double M, M_kin;           /* inertia of eq. (8), and the one that stores energy */
    double a;                  /* h/2 k_g A_mc: shaft speed to chamber volume, and back */
    double K_lf, pd_gain;      /* pipe resistance; caliper's share of a pressure difference */
    double g;                  /* h/2 / K_lf with the caliper eliminated */
    double V0, V1;             /* (chamber volume)/beta + g = V0 - V1 theta */
    double brk_p, brk_n;       /* k_brk - 1 */
    double T_pr, f_p, f_n, mu; /* friction times the step */
    double still;              /* speed beyond which the Stribeck peak has vanished */
    double aa, p_gain, p_zero, i_gain, i_zero; /* anti-alias filter; sensors to shares */
    double lp_g, lp_a;         /* low-pass filter of the ECU */
    double c1, c2, c3;         /* series of the flow energy, see pipe_loss */
} Plant;

/* Factors that also depend on the duty cycle, which the ECU holds for a tick.
 *
 * Winding, with R the resistances of winding and of the battery seen through the bridge:
 *     i+ = alpha i + drive - gamma (om + om+)
 * Caliper: dp_pd = pd_gain (2 (p_mc - p_pd) + dp_mc)
 * Chamber: dp_mc = (a (om + om+) - 2 g (p_mc - p_pd)) / P,  P = V0 - V1 theta_mid
 * put into the shaft's row give
 *     S om+ = c + h T_fr,  S = M + loss + a^2/P,
 *     c = (M - loss - a^2/P) om + eta_i ((1 + alpha) i + drive) - 2 a (p_mc - g (p_mc - p_pd)/P) */
typedef struct {
    double alpha, drive, gamma; /* the winding's row */
    double ahead, behind;       /* M + loss, M - loss */
    double from_i, constant;    /* eta_i (1 + alpha), eta_i drive */
} Held;

/* State between substeps, and sums over the substeps of a tick (midpoint values, twice). */
typedef struct {
    double i, th, om, pm, pd, yp, yi;
    double di, dth, dom, dpm; /* half of the last increment: what predicts the midpoint */
    double friction, makeup, near_stop, far_stop; /* friction times the step */
    double sum_i, sum_ii, sum_oo, sum_io, sum_fo, sum_pipe, sum_stop, sum_port, stuck;
    double unsettled, repeated;
} Sim;

static inline double max2(double a, double b) { return a > b ? a : b; }
static inline double min2(double a, double b) { return a < b ? a : b; }
static inline double clip(double x, double low, double high) { return min2(max2(x, low), high); }

static Plant prepare(const double *p, double h)
{
    Plant k = {.raw = p, .h = h, .half = 0.5 * h};
    const double k_g = p[P_gear_k_g], A = p[P_master_cylinder_A_mc], beta = p[P_fluid_beta];
    const double A_pl = PI / 4.0 * p[P_pipeline_d_pl] * p[P_pipeline_d_pl];
    const double spring = p[P_caliper_A_pd] * p[P_caliper_A_pd] / p[P_caliper_K_pd];
    k.M = p[P_gear_eta_g] * p[P_gear_J_mot] + k_g * k_g * p[P_gear_M_mc];
    k.M_kin = p[P_gear_J_mot] + k_g * k_g * p[P_gear_M_mc];
    k.a = k.half * k_g * A;
    k.K_lf = p[P_pipeline_k_lf] * p[P_fluid_nu] * p[P_fluid_rho] * PI * p[P_pipeline_L_pl]
             / (A_pl * A_pl);
    const double conductance = k.half / k.K_lf;
    k.pd_gain = conductance / (spring + conductance);
    k.g = conductance * (1.0 - k.pd_gain);
    k.V0 = A * p[P_master_cylinder_s_mc] / beta + k.g;
    k.V1 = A * k_g / beta;
    k.brk_p = p[P_seal_k_brk_p] - 1.0;
    k.brk_n = p[P_seal_k_brk_n] - 1.0;
    k.T_pr = h * p[P_seal_T_pr];
    k.f_p = h * p[P_seal_f_cfr_p];
    k.f_n = h * p[P_seal_f_cfr_n];
    k.mu = h * p[P_seal_mu_T];
    k.still = FAR_DECAYED / p[P_seal_c];
    const double a_aa = 2.0 * PI * p[P_anti_alias_f_aa];
    k.aa = h * a_aa / (1.0 + k.half * a_aa);
    k.p_gain = 1.0 / (p[P_pressure_sensor_p_high] - p[P_pressure_sensor_p_low]);
    k.p_zero = (p[P_fluid_p_atm] - p[P_pressure_sensor_p_low]) * k.p_gain;
    k.i_gain = 1.0 / (p[P_current_sensor_i_high] - p[P_current_sensor_i_low]);
    k.i_zero = -p[P_current_sensor_i_low] * k.i_gain;
    k.lp_g = tan(PI * p[P_ecu_filter_f_c] * p[P_ecu_T_s]);
    k.lp_a = 1.0 / (1.0 + 2.0 * p[P_ecu_filter_zeta] * k.lp_g + k.lp_g * k.lp_g);
    k.c1 = 1.0 / (2.0 * beta);
    k.c2 = k.c1 / (3.0 * beta);
    k.c3 = k.c2 / (4.0 * beta);
    return k;
}

static Held hold(const Plant *k, double duty)
{
    const double *p = k->raw;
    const double R = p[P_motor_R_m] + p[P_supply_R_bat] * duty * duty;
    const double pivot = 1.0 / (p[P_motor_L_m] + k->half * R);
    const double eta_i = k->half * p[P_gear_eta_g] * p[P_motor_K_e];
    Held u;
    u.alpha = (p[P_motor_L_m] - k->half * R) * pivot;
    u.drive = k->h * p[P_supply_V_bat] * duty * pivot;
    u.gamma = k->half * p[P_motor_K_e] * pivot;
    const double k_g = p[P_gear_k_g];
    const double loss = eta_i * u.gamma + k->half * k_g * k_g * p[P_master_cylinder_k_damp];
    u.ahead = k->M + loss;
    u.behind = k->M - loss;
    u.from_i = eta_i * (1.0 + u.alpha);
    u.constant = eta_i * u.drive;
    return u;
}

/* Flow energy that the pipe turns into heat, over (a - b): with h(p) the series of
 * beta (exp(p/beta) - 1) to the fourth power, (h(a) - h(b)) / (a - b). */
static inline double pipe_loss(const Plant *k, double a, double b)
{
    const double s = a + b, t = a * a + b * b;
    return 1.0 + s * (k->c1 + k->c3 * t) + k->c2 * (t + a * b);
}

/* Solve one substep for given contacts. The bools are constants at every call, so the ordinary
 * substep carries nothing of contacts and of the limit. */
static inline Sim solve(const Plant *k, const Held *u, Sim s, bool touching, double k_near,
                        double k_far, bool at_limit)
{
    const double *p = k->raw;
    /* Friction at the predicted midpoint, times the step; exp comes first, its latency counts. */
    const double speed = fabs(s.om + s.dom);
    const double decay = speed < k->still ? exp(-p[P_seal_c] * speed) : 0.0;
    const double p_mid = s.pm + s.dpm;
    const double load = max2(p_mid, 0.0);

    const double drop = s.pm - s.pd;
    const double r = 1.0 / (k->V0 - k->V1 * (s.th + s.dth));
    const double gr = k->g * r, aar = at_limit ? 0.0 : k->a * k->a * r;
    double S = u->ahead + aar;
    double c = (u->behind - aar) * s.om + u->from_i * s.i + u->constant
               - 2.0 * k->a * (at_limit ? 0.5 * s.pm : s.pm - gr * drop);
    if (touching) {
        const double k_g = p[P_gear_k_g], tau = p[P_stop_tau_stop];
        const double lag = 0.5 * k->half, x = k_g * s.th;
        const double kk = k->half * k_g * k_g * (k_near + k_far);
        const double depth = k_far * (x - p[P_master_cylinder_x_end])
                             + k_near * (x - p[P_master_cylinder_x_rest]);
        S += kk * (k->half + tau);
        c -= kk * (k->half - tau) * s.om + k->h * k_g * (depth + (k_near + k_far) * k_g * tau * s.om);
        (void)lag;
    }
    /* The friction opposes the speed that would come without it, and at most stops the shaft. */
    const bool apply = c > 0.0;
    const double coulomb = k->T_pr + (apply ? k->f_p : k->f_n) * load;
    const double T = coulomb + coulomb * (apply ? k->brk_p : k->brk_n) * decay + k->mu * speed;
    const double left = max2(fabs(c) - T, 0.0);
    const double om = copysign(left, c) * (1.0 / S);

    const double both = s.om + om, i = u->alpha * s.i + u->drive - u->gamma * both;
    const double dpm = at_limit ? -s.pm : k->a * r * both - 2.0 * gr * drop;
    const double dpd = k->pd_gain * (2.0 * drop + dpm);
    const double p_share = clip(k->p_gain * p_mid + k->p_zero, 0.0, 1.0);
    const double i_share = clip(k->i_gain * (s.i + s.di) + k->i_zero, 0.0, 1.0);
    s.yp += k->aa * (p_share - s.yp);
    s.yi += k->aa * (i_share - s.yi);

    s.friction = S * om - c;
    const double two_i = s.i + i, two_a = 2.0 * s.pm + dpm, two_b = 2.0 * s.pd + dpd;
    s.sum_i += two_i;
    s.sum_ii += two_i * two_i;
    s.sum_oo += both * both;
    s.sum_io += two_i * both;
    s.sum_fo += s.friction * both;
    s.sum_pipe += (two_a - two_b) * (two_a - two_b) * pipe_loss(k, 0.5 * two_a, 0.5 * two_b);
    s.stuck += both == 0.0 ? 1.0 : 0.0;

    s.di = 0.5 * (i - s.i);
    s.dom = 0.5 * (om - s.om);
    s.dth = 0.5 * k->half * both;
    s.dpm = 0.5 * dpm;
    if (at_limit) /* what the reservoir adds to keep the chamber at ambient pressure */
        s.makeup = (dpm / r - k->a * both + 2.0 * k->g * drop) / k->h;
    s.i = i;
    s.th += k->half * both;
    s.om = om;
    s.pm = at_limit ? 0.0 : s.pm + dpm;
    s.pd += dpd;
    return s;
}
