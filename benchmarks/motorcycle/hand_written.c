/* The motorcycle brake and its ECU, written by hand for this one brake, its default choices
 * (peers/hand_c.py lists them) and one time-stepping scheme: the yardstick for bywire's kernels.
 *
 * Implicit midpoint with the midpoint predicted from the last increment, one dry friction that
 * holds a resting shaft or opposes a turning one, substeps cut where the speed passes zero, two end
 * stops, and a chamber pressure that cannot fall below zero. All rows but the shaft's are
 * eliminated on paper, see struct Held.
 *
 * The line below is replaced by enums P_, X_, M_, U_, E_ and O_ of parameters, state, memory,
 * stimulus, energies and outputs, generated from the model. */
#include "hand_written_indices.h"
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define PI 3.14159265358979323846
#define CAP 8            /* passes after which a substep whose contacts change is let go */
#define FAR_DECAYED 40.0 /* exp(-40) is far below the last digit of 1 */
#define TRIES 12         /* lengths tried to find where a speed passes zero */
#define CLOSE 1e-12      /* share of a speed's change that counts as zero there */
#define NEAR 1e-9        /* share within which a line through two lengths leads there */
#define EDGE 1e-6        /* least share of a part that is cut off or left */
#define CUTS 4           /* after which a substep is let go */
#define BRINK 1e-9       /* share of the stroke at which a stop counts as near */
/* gcc -O2 leaves the two large pieces of a substep out of line, and they take a third longer. */
#define INLINE static inline __attribute__((always_inline))

/* Factors that depend on parameters and step only. */
typedef struct {
    const double *raw;
    double h, half, quarter;          /* step, and parts of it */
    double L, R_m, K_e, V_bat, R_bat; /* motor and battery */
    double k_g, eta, J_mot, M, J; /* gear; inertia of eq. (8), and the one that stores energy */
    double A, k_damp, beta, pads; /* piston, damping, bulk modulus, compliance of the caliper */
    double a, aa, two_a;          /* h/2 k_g A: shaft to chamber and back; its square, twice it */
    double K_lf, pd_gain;         /* pipe resistance; caliper's share of a pressure difference */
    double g, two_g;              /* h/2 / K_lf with the caliper eliminated; twice it */
    double V0, V1;                /* (chamber volume)/beta + g = V0 - V1 theta */
    double T_pr, f_p, f_n, mu, brk_p, brk_n; /* friction times the step; k_brk - 1 */
    double c, still;              /* Stribeck decay, and the speed beyond which nothing is left */
    double k_stop, x_rest, x_end, tau, th_mid, th_free; /* end stops; free angles between them */
    double lag, p_gain, p_zero, i_gain, i_zero; /* anti-alias filter; sensors to shares */
    double lp_g, lp_a, c1, c2, c3; /* low-pass filter of the ECU; series in pipe_loss */
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
typedef struct { double alpha, drive, gamma, ahead, behind, from_i, constant; } Held;

/* State between substeps, and sums over the substeps of a tick: midpoint values, most of them
 * twice or squared twice, whose constant factors wait for the end of the tick. */
typedef struct { double i, ii, oo, io, fo, pipe, stop, port, stuck; } Sums;
typedef struct {
    double i, th, om, pm, pd, yp, yi;
    double di, dth, dom, dpm; /* half of the last increment: it predicts the midpoint */
    double impulse, makeup; /* impulse: friction torque times h */
    double unsettled, careful; /* numbers of substeps */
    Sums sum;
} Sim;

/* What a run carries from tick to tick: plant, ECU memory, energies. */
typedef struct { Sim s; double m[M_COUNT], e[E_COUNT]; } Saved;

/* Which of the stops push, as stiffnesses, and whether the chamber is held at zero pressure. */
typedef struct { bool touching, held; double k_near, k_far; } Sides;
typedef struct { double om, i, dpm, dpd, impulse; } Pass;

INLINE double max2(double a, double b) { return a > b ? a : b; }
INLINE double min2(double a, double b) { return a < b ? a : b; }
INLINE double clip(double x, double low, double high) { return min2(max2(x, low), high); }

/* The factors that depend on the step, for another one. */
static Plant with_step(const Plant *any, double h)
{
    Plant k = *any;
    const double *p = k.raw;
    k.h = h, k.half = 0.5 * h, k.quarter = 0.25 * h;
    k.a = k.half * k.k_g * k.A, k.aa = k.a * k.a, k.two_a = 2.0 * k.a;
    const double G = k.half / k.K_lf, w_aa = 2.0 * PI * p[P_anti_alias_f_aa];
    k.pd_gain = G / (k.pads + G), k.g = G * (1.0 - k.pd_gain), k.two_g = 2.0 * k.g;
    k.V0 = k.A * p[P_master_cylinder_s_mc] / k.beta + k.g;
    k.f_p = h * p[P_seal_f_cfr_p], k.f_n = h * p[P_seal_f_cfr_n];
    k.T_pr = h * p[P_seal_T_pr], k.mu = h * p[P_seal_mu_T];
    k.lag = h * w_aa / (1.0 + k.half * w_aa);
    return k;
}

static Plant prepare(const double *p, double h)
{
    Plant k = {.raw = p};
    k.L = p[P_motor_L_m], k.R_m = p[P_motor_R_m], k.K_e = p[P_motor_K_e];
    k.V_bat = p[P_supply_V_bat], k.R_bat = p[P_supply_R_bat], k.beta = p[P_fluid_beta];
    k.k_g = p[P_gear_k_g], k.eta = p[P_gear_eta_g], k.J_mot = p[P_gear_J_mot];
    k.J = k.J_mot + k.k_g * k.k_g * p[P_gear_M_mc], k.M = k.J - (1.0 - k.eta) * k.J_mot;
    k.A = p[P_master_cylinder_A_mc], k.k_damp = p[P_master_cylinder_k_damp];
    const double A_pl = PI / 4.0 * p[P_pipeline_d_pl] * p[P_pipeline_d_pl];
    k.K_lf = p[P_pipeline_k_lf] * p[P_fluid_nu] * p[P_fluid_rho] * PI * p[P_pipeline_L_pl]
             / (A_pl * A_pl);
    k.pads = p[P_caliper_A_pd] * p[P_caliper_A_pd] / p[P_caliper_K_pd];
    k.V1 = k.A * k.k_g / k.beta;
    k.brk_p = p[P_seal_k_brk_p] - 1.0, k.brk_n = p[P_seal_k_brk_n] - 1.0;
    k.c = p[P_seal_c], k.still = FAR_DECAYED / k.c;
    k.k_stop = p[P_stop_k_stop], k.tau = p[P_stop_tau_stop];
    k.x_rest = p[P_master_cylinder_x_rest], k.x_end = p[P_master_cylinder_x_end];
    k.th_mid = 0.5 * (k.x_end + k.x_rest) / k.k_g;
    k.th_free = (0.5 - BRINK) * (k.x_end - k.x_rest) / k.k_g;
    k.p_gain = 1.0 / (p[P_pressure_sensor_p_high] - p[P_pressure_sensor_p_low]);
    k.p_zero = (p[P_fluid_p_atm] - p[P_pressure_sensor_p_low]) * k.p_gain;
    k.i_gain = 1.0 / (p[P_current_sensor_i_high] - p[P_current_sensor_i_low]);
    k.i_zero = -p[P_current_sensor_i_low] * k.i_gain;
    k.lp_g = tan(PI * p[P_ecu_filter_f_c] * p[P_ecu_T_s]);
    k.lp_a = 1.0 / (1.0 + 2.0 * p[P_ecu_filter_zeta] * k.lp_g + k.lp_g * k.lp_g);
    k.c1 = 1.0 / (2.0 * k.beta), k.c2 = k.c1 / (3.0 * k.beta), k.c3 = k.c2 / (4.0 * k.beta);
    return with_step(&k, h);
}

static Held hold(const Plant *k, double duty)
{
    const double R = k->R_m + k->R_bat * duty * duty;
    const double pivot = 1.0 / (k->L + k->half * R), eta_i = k->half * k->eta * k->K_e;
    Held u = {.alpha = (k->L - k->half * R) * pivot, .gamma = k->half * k->K_e * pivot,
              .drive = k->h * k->V_bat * duty * pivot};
    const double loss = eta_i * u.gamma + k->half * k->k_g * k->k_g * k->k_damp;
    u.ahead = k->M + loss, u.behind = k->M - loss;
    u.from_i = eta_i * (1.0 + u.alpha), u.constant = eta_i * u.drive;
    return u;
}

/* (h(a) - h(b)) / (a - b) for the energy h that a volume flow carries at a pressure p,
 * the series of beta (exp(p/beta) - 1) to the fourth power: what the pipe turns into heat. */
INLINE double pipe_loss(const Plant *k, double a, double b)
{
    const double s = a + b, t = a * a + b * b;
    return 1.0 + s * (k->c1 + k->c3 * t) + k->c2 * (t + a * b);
}

/* Solve one substep for given sides. In the ordinary substep they are constants, and what
 * belongs to stops and limit is not compiled into it. */
INLINE Pass solve(const Plant *k, const Held *u, const Sim *s, Sides side)
{
    const double speed = fabs(s->om + s->dom);
    const double decay = speed < k->still ? exp(-k->c * speed) : 0.0;
    const double drop = s->pm - s->pd, r = 1.0 / (k->V0 - k->V1 * (s->th + s->dth));
    const double spring = side.held ? 0.0 : k->aa * r;
    const double p_mean = side.held ? 0.5 * s->pm : s->pm - k->g * r * drop;
    double S = u->ahead + spring;
    double c = (u->behind - spring) * s->om + u->from_i * s->i + u->constant - k->two_a * p_mean;
    if (side.touching) {
        const double stiff = side.k_near + side.k_far, x = k->k_g * (s->th + k->tau * s->om);
        const double force = side.k_near * (x - k->x_rest) + side.k_far * (x - k->x_end);
        S += k->half * k->k_g * k->k_g * stiff * (k->half + k->tau);
        c -= k->half * k->k_g * (2.0 * force + k->k_g * stiff * (k->half - k->tau) * s->om);
    }
    /* Friction opposes the speed that the shaft has, or holds it at rest as far as it can. */
    const double way = s->om != 0.0 ? s->om : c, load = max2(s->pm + s->dpm, 0.0);
    const double coulomb = k->T_pr + (way > 0.0 ? k->f_p : k->f_n) * load;
    const double peak = coulomb * (way > 0.0 ? k->brk_p : k->brk_n);
    const double limit = (coulomb + k->mu * speed) + peak * decay;

    Pass q;
    q.impulse = -copysign(s->om == 0.0 && fabs(c) < limit ? fabs(c) : limit, way);
    q.om = (c + q.impulse) * (1.0 / S);
    const double both = s->om + q.om;
    q.i = u->alpha * s->i + u->drive - u->gamma * both;
    q.dpm = side.held ? -s->pm : r * (k->a * both - k->two_g * drop);
    q.dpd = k->pd_gain * (2.0 * drop + q.dpm);
    return q;
}

INLINE void predict(const Plant *k, Sim *s, Pass q)
{
    s->di = 0.5 * (q.i - s->i), s->dth = k->quarter * (s->om + q.om);
    s->dom = 0.5 * (q.om - s->om), s->dpm = 0.5 * q.dpm;
}

/* Take over a part of a substep, as a share of it. */
INLINE void commit(const Plant *k, Sim *s, Pass q, double share)
{
    const double p_share = clip(k->p_gain * (s->pm + s->dpm) + k->p_zero, 0.0, 1.0);
    const double i_share = clip(k->i_gain * (s->i + s->di) + k->i_zero, 0.0, 1.0);
    s->yp += k->lag * (p_share - s->yp), s->yi += k->lag * (i_share - s->yi);
    const double two_i = s->i + q.i, two_om = s->om + q.om;
    const double pm = s->pm + 0.5 * q.dpm, pd = s->pd + 0.5 * q.dpd;
#ifndef WITHOUT_SUMS /* compiled out for who records no energy */
    s->sum.i += share * two_i, s->sum.ii += share * (two_i * two_i);
    s->sum.io += share * (two_i * two_om), s->sum.oo += share * (two_om * two_om);
    s->sum.fo += q.impulse * two_om;
    s->sum.pipe += share * ((pm - pd) * (pm - pd) * pipe_loss(k, pm, pd));
    s->sum.stuck += two_om == 0.0 ? share : 0.0;
#endif
    predict(k, s, q);
    s->impulse = q.impulse / share, s->i = q.i;
    s->th += k->half * two_om;
    s->om = q.om, s->pm += q.dpm, s->pd += q.dpd;
}

static Sides touching_sides(const Plant *k, double th, double om)
{
    const double x = k->k_g * th, ahead = k->tau * (k->k_g * om);
    return (Sides){.touching = true, .k_near = k->x_rest - x - ahead > 0.0 ? k->k_stop : 0.0,
                   .k_far = x - k->x_end + ahead > 0.0 ? k->k_stop : 0.0};
}

/* Book what only a substep at a stop or at the limit has: reactions and their energies. */
static void book_sides(const Plant *k, Sim *s, Pass q, Sides side, double share)
{
    const double both = s->om + q.om, v = k->k_g * 0.5 * both;
    const double x = k->k_g * (s->th + k->quarter * both);
    const double near = k->x_rest - x, far = x - k->x_end;
    const double force = side.k_far * (far + k->tau * v) - side.k_near * (near - k->tau * v);
    s->sum.stop += share * (force * v);
    /* What the chamber's balance lacks, the reservoir adds. */
    const double P = k->V0 - k->V1 * (s->th + s->dth), pm = s->pm + 0.5 * q.dpm;
    const double lack = P * q.dpm - k->a * both + k->two_g * (s->pm - s->pd);
    s->makeup = side.held ? lack / k->h : 0.0;
    s->sum.port -= share * (s->makeup * pm * pipe_loss(k, pm, 0.0));
}

/* A part of a substep, from s on: what its length gives. */
typedef struct { Plant k; Sim s; Pass q; Sides side; bool settled; } Part;

/* Pass after pass, each with the contacts at the midpoint that the one before gave, until they
 * stay the same. */
static void settle(Part *y, double duty)
{
    const Plant *k = &y->k;
    const Held u = hold(k, duty);
    Sim *s = &y->s;
    for (int pass = 1;; pass++) {
        y->side = touching_sides(k, s->th + s->dth, s->om + s->dom);
        y->q = solve(k, &u, s, y->side);
        if (s->pm + y->q.dpm < 0.0) {
            y->side.held = true;
            y->q = solve(k, &u, s, y->side);
        }
        const double both = s->om + y->q.om;
        const Sides after = touching_sides(k, s->th + k->quarter * both, 0.5 * both);
        y->settled = y->side.k_near == after.k_near && y->side.k_far == after.k_far;
        if (y->settled || pass == CAP)
            return;
        predict(k, s, y->q);
    }
}

/* Scale the predicted half increments. */
static void stretch(Sim *s, double by)
{
    s->di *= by, s->dth *= by, s->dom *= by, s->dpm *= by;
}

static void try_part(Part *y, const Plant *k, double duty, const Sim *s, double t)
{
    y->k = with_step(k, t), y->s = *s;
    stretch(&y->s, t / k->h);
    settle(y, duty);
}

/* By how much half an increment of the speed is less behind a zero: friction jumps, and opposes the
 * other direction, or holds. */
static __attribute__((noinline, cold)) double jump(const Part *y)
{
    const Plant *k = &y->k;
    const double speed = fabs(y->s.om + y->s.dom), load = max2(y->s.pm + y->s.dpm, 0.0);
    const double decay = speed < k->still ? exp(-k->c * speed) : 0.0;
    const double ahead = (k->T_pr + k->f_p * load) * (1.0 + k->brk_p * decay);
    const double back = (k->T_pr + k->f_n * load) * (1.0 + k->brk_n * decay);
    return (0.5 * (ahead + back) + k->mu * speed) / k->M;
}

/* Shorten a part of length t to where the speed is zero: by the parabola through three lengths,
 * within what is known to lie before and behind. Return the length. */
static double shorten(Part *y, const Plant *k, double duty, const Sim *s, double t)
{
    const double first = EDGE * t, final = (1.0 - EDGE) * t;
    double low = 0.0, high = t, P = 0.0, at_P = s->om, Q = t, at_Q = y->q.om;
    const double change = fabs(at_P - at_Q);
    double N = t * at_P / (at_P - at_Q), before = 0.0;
    Pass was = y->q;
    for (int n = 1;; n++) {
        N = clip(N, first, final);
        try_part(y, k, duty, s, N);
        const double at_N = y->q.om;
        if (fabs(at_N) <= CLOSE * change || N <= first || N >= final || N == P || N == Q || n == TRIES)
            break;
        if (at_N * s->om > 0.0)
            low = N;
        else
            high = N;
        const double slope = (at_N - at_P) / (N - P) + (at_N - at_Q) / (N - Q)
                             - (at_Q - at_P) / (Q - P);
        const double next = N - at_N / slope;
        if (fabs(at_N) <= NEAR * change && before > 0.0 && next > first && next < final) {
            const double share = (next - N) / (N - before);
            y->q.om += share * (y->q.om - was.om), y->q.i += share * (y->q.i - was.i);
            y->q.dpm += share * (y->q.dpm - was.dpm), y->q.dpd += share * (y->q.dpd - was.dpd);
            y->q.impulse += share * (y->q.impulse - was.impulse);
            N = next, y->k = with_step(k, N);
            break;
        }
        was = y->q, before = N;
        if (fabs(P - next) > fabs(Q - next))
            P = N, at_P = at_N;
        else
            Q = N, at_Q = at_N;
        N = next > low && next < high ? next : 0.5 * (low + high);
    }
    return N;
}

/* A substep near a stop, with the pressure about to fall below zero, or in which the speed passes
 * zero: there it is cut, for friction jumps, and the shaft rests or turns on as friction decides,
 * from whose jump the midpoint behind the cut is predicted. */
static __attribute__((noinline, cold)) void careful(const Plant *k, double duty, Sim *s)
{
    double left = k->h;
    bool settled = true;
    Part y;
    for (int cuts = 0;; cuts++) {
        try_part(&y, k, duty, s, left);
        const bool turns = s->om * y.q.om < 0.0, cut = turns && cuts < CUTS;
        if (turns && !cut)
            y.q.om = 0.0;
        const double t = cut ? shorten(&y, k, duty, s, left) : left, share = t / k->h;
        const double less = cut ? jump(&y) / share : 0.0;
        settled &= y.settled && turns == cut;
        book_sides(&y.k, &y.s, y.q, y.side, share);
        commit(&y.k, &y.s, y.q, share);
        *s = y.s;
        stretch(s, 1.0 / share);
        if (!cut)
            break;
        s->om = 0.0, s->dom = copysign(max2(fabs(s->dom) - less, 0.0), s->dom), left -= t;
    }
    s->careful += 1.0, s->unsettled += !settled;
}

INLINE bool free_of_stops(const Plant *k, double th, double om)
{
    return fabs(th - k->th_mid) + k->tau * fabs(om) < k->th_free;
}

/* Ordinary substeps, away from stops and limit: at most n; return how many. They work on a copy
 * of the state whose address nobody else has, so that the compiler may keep it in registers. */
static int64_t advance(const Plant *k, const Held *u, Sim *state, int64_t n)
{
    Sim s = *state;
    int64_t done = 0;
    for (; done < n && free_of_stops(k, s.th + s.dth, s.om + s.dom); done++) {
        const Pass q = solve(k, u, &s, (Sides){.touching = false, .held = false});
        const double both = s.om + q.om;
        if (s.om * q.om < 0.0 || s.pm + q.dpm < 0.0
            || !free_of_stops(k, s.th + k->quarter * both, 0.5 * both))
            break;
        commit(k, &s, q, 1.0);
    }
    if (done)
        s.makeup = 0.0;
    *state = s;
    return done;
}

/* The ECU's tick: convert, pressure PID, dither, low-pass, current PI. */
static void tick(const Plant *k, Saved *z, const double *u)
{
    const double *p = k->raw, T = p[P_ecu_T_s], codes = p[P_adc_codes], noise = p[P_adc_noise];
    double *m = z->m;
    const double code_p = floor((z->s.yp + noise * u[U_noise_p]) * codes + 0.5);
    const double code_i = floor((z->s.yi + noise * u[U_noise_i]) * codes + 0.5);
    const double p_low = p[P_pressure_sensor_p_low], p_span = p[P_pressure_sensor_p_high] - p_low;
    const double i_low = p[P_current_sensor_i_low], i_span = p[P_current_sensor_i_high] - i_low;
    const double p_meas = p_low + clip(code_p, 0.0, codes - 1.0) / codes * p_span - p[P_ecu_p_atm];
    const double i_meas = i_low + clip(code_i, 0.0, codes - 1.0) / codes * i_span;
    const double p_ref = u[U_p_set], i_max = p[P_ecu_pressure_i_max];
    const double signal = p[P_ecu_pressure_c] * p_ref - p_meas, tau_d = p[P_ecu_pressure_tau_d];
    const double slope = (tau_d * m[M_pid_slope] + p[P_ecu_pressure_k_d] * (signal - m[M_pid_last]))
                         / (tau_d + T);
    const double i_wanted = p[P_ecu_pressure_k_p] * (p[P_ecu_pressure_b] * p_ref - p_meas)
                            + m[M_pid_integral] + slope;
    const double i_star = clip(i_wanted, -i_max, i_max);
    const double growth = (i_star - i_wanted) / p[P_ecu_pressure_T_t];
    m[M_pid_integral] += T * (p[P_ecu_pressure_k_i] * (p_ref - p_meas) + growth);

    const double believed = p[P_ecu_est_par_T_pr] + p[P_ecu_est_par_f_cfr_p] * max2(p_meas, 0.0);
    const double i_brk = p[P_ecu_est_par_k_brk_p] * believed / p[P_ecu_est_par_K_e];
    const double i_dit = p[P_ecu_dither_gain] * i_brk * sin(2.0 * PI * m[M_dit_phase]);
    const double phase = m[M_dit_phase] + p[P_ecu_dither_f_dit] * T;
    m[M_dit_phase] = phase - floor(phase + 1e-9);
    const double band = k->lp_a * (m[M_lp_s1] + k->lp_g * (i_star + i_dit - m[M_lp_s2]));
    const double i_ref = m[M_lp_s2] + k->lp_g * band;
    m[M_lp_s1] = 2.0 * band - m[M_lp_s1], m[M_lp_s2] = 2.0 * i_ref - m[M_lp_s2];

    const double error = i_ref - i_meas, D_max = p[P_ecu_current_D_max];
    const double limit = min2(D_max, p[P_bridge_D_max]);
    const double wanted = p[P_ecu_current_k_p] * error + m[M_pi_integral];
    m[M_duty] = clip(wanted, -limit, limit);
    const double unwind = (m[M_duty] - wanted) / p[P_ecu_current_T_t];
    m[M_pi_integral] += T * (p[P_ecu_current_k_i] * error + unwind);
    m[M_p_meas] = p_meas, m[M_i_meas] = i_meas, m[M_pid_slope] = slope, m[M_pid_last] = signal;
    m[M_p_ref] = p_ref, m[M_i_star] = i_star, m[M_i_dit] = i_dit, m[M_i_ref] = i_ref;
    m[M_sat_current] = fabs(i_star) >= i_max, m[M_sat_duty] = fabs(m[M_duty]) >= limit;
}

/* Integral of the flow energy over pressure, 0 to q: beta times the energy stored per volume. */
static double density(const Plant *k, double q)
{
    const double z = q / k->beta;
    return 0.5 * q * q * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0)));
}

static void record(const Plant *k, const Saved *z, double *o)
{
    const double *p = k->raw, *m = z->m, *e = z->e, friction = z->s.impulse / k->h;
    const double i = z->s.i, om = z->s.om, p_mc = z->s.pm, p_pd = z->s.pd, duty = m[M_duty];
    const double x_mc = k->k_g * z->s.th, torque = k->K_e * i;
    const double q = (p_mc - p_pd) / k->K_lf, ahead = k->tau * (k->k_g * om);
    const double F_stop = k->k_stop * (max2(x_mc - k->x_end + ahead, 0.0)
                                       - max2(k->x_rest - x_mc - ahead, 0.0));
    const double load = k->k_g * (p_mc * k->A + k->k_damp * k->k_g * om + F_stop);
    const double accel = (k->eta * torque - load + friction) / k->M;
    const double near = max2(k->x_rest - x_mc, 0.0), far = max2(x_mc - k->x_end, 0.0);
    const double chamber = k->A * (p[P_master_cylinder_s_mc] - x_mc) / k->beta;
    o[O_i] = i, o[O_i_ref] = m[M_i_ref], o[O_i_star] = m[M_i_star], o[O_i_dit] = m[M_i_dit];
    o[O_i_meas] = m[M_i_meas], o[O_duty] = duty, o[O_P_el] = k->V_bat * duty * i;
    o[O_voltage] = (k->V_bat - k->R_bat * duty * i) * duty;
    o[O_P_gear] = (1.0 - k->eta) * (torque - k->J_mot * accel) * om;
    o[O_theta] = z->s.th, o[O_omega] = om, o[O_x_mc] = x_mc, o[O_torque] = torque;
    o[O_p_mc] = p_mc, o[O_p_pd] = p_pd, o[O_p_ref] = m[M_p_ref], o[O_p_meas] = m[M_p_meas];
    o[O_V_pedal] = m[M_V_pedal], o[O_q] = q, o[O_q_makeup] = z->s.makeup;
    o[O_Re] = 4.0 / PI * fabs(q) / (p[P_pipeline_d_pl] * p[P_fluid_nu]);
    o[O_T_fr] = -friction, o[O_F_stop] = F_stop, o[O_at_stop] = F_stop != 0.0;
    o[O_stuck] = om == 0.0, o[O_sat_current] = m[M_sat_current], o[O_sat_duty] = m[M_sat_duty];
    o[O_E_source] = e[E_E_source], o[O_E_supply] = e[E_E_supply], o[O_E_copper] = e[E_E_copper];
    o[O_E_gear] = e[E_E_gear], o[O_E_seal] = e[E_E_seal], o[O_E_damping] = e[E_E_damping];
    o[O_E_pipeline] = e[E_E_pipeline], o[O_E_port] = e[E_E_port];
    o[O_E_stop] = e[E_W_stop] - 0.5 * k->k_stop * (near * near + far * far);
    o[O_W_shaft] = e[E_W_shaft], o[O_t_stuck] = e[E_t_stuck], o[O_derated] = 0.0;
    o[O_T_winding] = o[O_T_housing] = p[P_motor_heat_T_a]; /* a motor that stays cold */
    o[O_E_warming] = o[O_E_winding] = o[O_E_housing] = o[O_E_motor_air] = 0.0;
    o[O_E_piston] = 0.0; /* one that does not stick */
    o[O_E_stored] = 0.5 * (k->L * i * i + k->J * om * om + k->k_stop * (near * near + far * far))
                    + chamber * density(k, p_mc) + k->pads * density(k, p_pd);
}

/* The substeps of one tick, and the energies that they add up to. */
static void frame(const Plant *k, Saved *z, int64_t steps)
{
    const double duty = z->m[M_duty], h = k->h, om_start = z->s.om;
    const Held u = hold(k, duty);
    z->s.sum = (Sums){0};
    for (int64_t n = 0; n < steps; n++) {
        n += advance(k, &u, &z->s, steps - n);
        if (n < steps)
            careful(k, duty, &z->s);
    }
    const Sums sum = z->s.sum;
    const double kinetic = 0.5 * (z->s.om * z->s.om - om_start * om_start); /* sum of om d(om) */
    const double work = 0.25 * h * k->K_e * sum.io;
    double *e = z->e;
    e[E_E_source] += 0.5 * h * k->V_bat * duty * sum.i;
    e[E_E_supply] += 0.25 * h * k->R_bat * duty * duty * sum.ii;
    e[E_E_copper] += 0.25 * h * k->R_m * sum.ii;
    e[E_E_gear] += (1.0 - k->eta) * (work - k->J_mot * kinetic), e[E_W_shaft] += work;
    e[E_E_damping] += 0.25 * h * k->k_damp * k->k_g * k->k_g * sum.oo;
    e[E_E_seal] -= 0.5 * sum.fo, e[E_E_pipeline] += h / k->K_lf * sum.pipe;
    e[E_W_stop] += h * sum.stop, e[E_E_port] += h * sum.port, e[E_t_stuck] += h * sum.stuck;
}

static void simulate(const double *p, double h, int64_t frames, int64_t steps, const double *u,
                     double *state, int64_t width, const int32_t *selected, double *rec)
{
    const Plant k = prepare(p, h);
    const double *x = state;
    Saved z = {.s = {.i = x[X_i], .th = x[X_theta], .om = x[X_omega], .pm = x[X_p_mc],
                     .pd = x[X_p_pd], .yp = x[X_y_p], .yi = x[X_y_i]}};
    memcpy(z.m, state + X_COUNT, sizeof z.m);
    double all[O_COUNT] = {0};
    for (int64_t n = 0; n <= frames; n++) {
        tick(&k, &z, u + n * U_COUNT);
        record(&k, &z, all);
        for (int64_t j = 0; j < width; j++)
            *rec++ = all[selected ? selected[j] : j];
        if (n < frames)
            frame(&k, &z, steps);
    }
    state[X_COUNT + M_COUNT] = z.s.unsettled, state[X_COUNT + M_COUNT + 1] = z.s.careful;
}

/* One run: frames ticks of steps substeps each, and a row of all outputs per tick and at the end.
 * u: frames + 1 rows of stimulus; state: the model's State and Memory at the start, then room for
 * the numbers of substeps that did not settle and that were near a stop or the limit. */
void hand_run(const double *p, double h, int64_t frames, int64_t steps, const double *u,
              double *state, double *rec)
{
    simulate(p, h, frames, steps, u, state, O_COUNT, NULL, rec);
}

/* The same for many cases, with one block of p, state and rec per case, a stimulus
 * shared by all, and only the selected outputs, width of them. */
void hand_ensemble(int64_t cases, const double *p, double h, int64_t frames, int64_t steps,
                   const double *u, double *state, int64_t width, const int32_t *selected,
                   double *rec)
{
    const int64_t length = X_COUNT + M_COUNT + 2, block = (frames + 1) * width;
    for (int64_t c = 0; c < cases; c++)
        simulate(p + c * P_COUNT, h, frames, steps, u, state + c * length, width, selected,
                 rec + c * block);
}
