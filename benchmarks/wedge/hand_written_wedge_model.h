/* The wedge brake but for its time stepping: constants, contacts, frictions, controllers and what
 * is recorded, for its default choices (peers/hand_wedge.py lists them). Shared by the implicit
 * scheme and by the explicit one with regularized friction.
 *
 * Screw 2 pushes the wedge toward clamping, screw 1 back; see plant/brake_heart.py. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define PI 3.14159265358979323846
#define STILL 1e-9   /* share of the reference speed below which nothing churns */
#define DECAYED 40.0 /* exp(-40) no longer shows beside 1 */
#define INLINE static inline __attribute__((always_inline))

/* One motor with its rotor; resistance and torque constant when warm. */
typedef struct { double R, L, K, J, D, T_cog, N_cog; } MotorPar;

/* Factors that depend on parameters and step only. */
typedef struct {
    const double *raw;
    double h, half;
    MotorPar motor[2];
    double w_d, w_s, G, i_max, k_p, k_i, T_t, V, R_off; /* drive */
    double lead, opposing, aiding;                   /* screw: m/rad; friction per axial force */
    double C_0, C_1, C_2, T_nu, k_nu, per_speed, G_S, decay; /* bearing */
    double W, s, q[3], g_1, g_2, g_12, tau;          /* heart, see pressed() */
    double tan, M_W, mu_B, k_return, x_stop, mu_int, mu_R, k_stop, tau_stop; /* wedge */
    double K_cal, tau_cal, clear, per_F_N, J_F, Om_still, runout; /* caliper, disc */
    double w_M, standby, tau_P, T_a;                 /* measurements */
} Plant;

typedef struct { double demand, sensed, integral, i, th, om; } Motor;
typedef struct { double f_1, f_2, f_12; } Heart;

/* State, and frictions of the last substep. */
typedef struct {
    Motor motor[2];
    double x, v, Om, phi, y_M, y_P;
    double friction[4];
} Body;

/* What a run carries from tick to tick: plant, memory of the controllers, energies. */
typedef struct { Body b; double m[M_COUNT], e[E_COUNT]; } Saved;

INLINE double max2(double a, double b) { return a > b ? a : b; }
INLINE double min2(double a, double b) { return a < b ? a : b; }
INLINE double clip(double x, double low, double high) { return min2(max2(x, low), high); }

static MotorPar motor_par(const double *p) /* p: the first parameter of a motor's group */
{
    const double dT = p[P_motor_1_dT - P_motor_1_R_ref];
    return (MotorPar){
        .R = p[0] * (1.0 + p[P_motor_1_a_R - P_motor_1_R_ref] * dT),
        .K = p[P_motor_1_K_ref - P_motor_1_R_ref] * (1.0 - p[P_motor_1_a_K - P_motor_1_R_ref] * dT),
        .L = p[P_motor_1_L_M - P_motor_1_R_ref], .J = p[P_motor_1_J_M - P_motor_1_R_ref],
        .D = p[P_motor_1_D_M - P_motor_1_R_ref], .T_cog = p[P_motor_1_T_cog - P_motor_1_R_ref],
        .N_cog = p[P_motor_1_N_cog - P_motor_1_R_ref]};
}

static Plant plant_of(const double *p, double h)
{
    Plant k = {.raw = p, .h = h, .half = 0.5 * h};
    k.motor[0] = motor_par(p + P_motor_1_R_ref), k.motor[1] = motor_par(p + P_motor_2_R_ref);
    k.w_d = 2.0 * PI * p[P_drive_f_demand], k.w_s = 2.0 * PI * p[P_drive_f_sense];
    k.G = p[P_drive_G_sense], k.i_max = p[P_drive_i_max], k.R_off = p[P_drive_R_off];
    k.k_p = p[P_drive_k_p], k.k_i = p[P_drive_k_i], k.T_t = p[P_drive_T_t], k.V = p[P_drive_V_dc];
    k.lead = p[P_screw_lead] / (2.0 * PI);
    k.opposing = (1.0 / p[P_screw_eta_f] - 1.0) * k.lead;
    k.aiding = (1.0 - p[P_screw_eta_b]) * k.lead;
    k.C_0 = p[P_bearing_C_0], k.C_1 = p[P_bearing_C_1], k.C_2 = p[P_bearing_C_2];
    k.T_nu = p[P_bearing_T_nu], k.k_nu = p[P_bearing_k_nu];
    k.per_speed = p[P_bearing_nu] / p[P_bearing_nu_ref] / p[P_bearing_omega_ref];
    k.G_S = p[P_bearing_G_S], k.decay = p[P_bearing_k_S] / p[P_bearing_omega_S];
    const double s = 1.0 / p[P_heart_K_S], w = s + 1.0 / p[P_heart_K_W];
    const double t = 2.0 * s + 1.0 / p[P_heart_K_C];
    k.W = 1.0 / w, k.s = s;
    for (int n = 0; n < 3; n++)
        k.q[n] = 1.0 / (t - n * s * s / w);
    k.g_1 = p[P_heart_g_1], k.g_2 = p[P_heart_g_2], k.g_12 = p[P_heart_g_12];
    k.tau = p[P_heart_tau_heart];
    k.tan = tan(p[P_wedge_alpha]), k.M_W = p[P_wedge_M_W], k.mu_B = p[P_wedge_mu_B];
    k.k_return = p[P_wedge_k_return], k.x_stop = p[P_wedge_x_stop];
    k.mu_int = p[P_wedge_friction_mu_int] * k.tan, k.mu_R = p[P_wedge_friction_mu_R];
    k.k_stop = p[P_stop_k_stop], k.tau_stop = p[P_stop_tau_stop];
    k.K_cal = p[P_caliper_K_cal], k.tau_cal = p[P_caliper_tau_cal];
    k.clear = p[P_caliper_clearance], k.per_F_N = 2.0 * k.mu_B * p[P_caliper_r_B];
    k.J_F = p[P_flywheel_J_F], k.Om_still = p[P_flywheel_Omega_still];
    k.runout = p[P_flywheel_runout], k.w_M = 2.0 * PI * p[P_moment_sensor_f_M];
    k.standby = p[P_supply_P_standby], k.tau_P = p[P_supply_tau_P], k.T_a = p[P_motor_heat_T_a];
    return k;
}

/* Forces of the heart's contacts at overlaps d: f_j = W max(0, d_j + s f_12) for the two contacts
 * of the wedge; what is left is piecewise linear in f_12, and its root the largest candidate. */
INLINE Heart pressed(const Plant *k, double d_1, double d_2, double d_12)
{
    const double share = k->s * k->W;
    const double one = k->q[1] * (d_12 + share * max2(d_1, d_2));
    const double both = k->q[2] * (d_12 + share * (d_1 + d_2));
    const double tips = max2(max2(k->q[0] * d_12, 0.0), max2(one, both));
    return (Heart){.f_1 = k->W * max2(d_1 + k->s * tips, 0.0),
                   .f_2 = k->W * max2(d_2 + k->s * tips, 0.0), .f_12 = tips};
}

/* Largest friction torque of bearings and screw on a shaft, for motion forward and back. */
typedef struct { double forward, back; } Grip;

INLINE Grip shaft_grip(const Plant *k, double force, double om)
{
    const double load = fabs(force), speed = fabs(om), far = k->decay * speed;
    const double ratio = k->per_speed * speed;
    const double axial = k->C_0 + load * (k->C_1 + k->C_2 * load);
    const double viscous = ratio > STILL ? k->T_nu * pow(ratio, k->k_nu) : 0.0;
    const double peak = far == 0.0 ? 1.0 : far < DECAYED ? exp(-far) : 0.0;
    const double bearing = axial * (1.0 + k->G_S * peak) + viscous;
    const double opposing = bearing + k->opposing * load, aiding = bearing + k->aiding * load;
    return (Grip){.forward = force < 0.0 ? opposing : aiding,
                  .back = force > 0.0 ? opposing : aiding};
}

INLINE double direction_of(const Plant *k, double Om)
{
    return Om > k->Om_still ? 1.0 : Om < -k->Om_still ? -1.0 : 0.0;
}

/* Voltage of a motor as its drive sets it. */
INLINE double voltage(const Plant *k, const MotorPar *q, const Motor *s, bool on)
{
    if (!on)
        return q->K * s->om - k->R_off * s->i;
    const double e = clip(s->demand, -k->i_max, k->i_max) - s->sensed;
    return k->V * clip(k->k_p * e + s->integral, -1.0, 1.0);
}

static double encoder(const Plant *k, double th)
{
    if (!QUANTIZED)
        return th;
    const double count = 2.0 * PI / k->raw[P_encoder_counts];
    return count * floor(th / count + 0.5);
}

/* Speed toward a position: limited in speed and acceleration, creeping at last. */
static double crossing(const double *p, double distance, double rate)
{
    const double creep = p[P_control_moment_omega_creep], a = p[P_control_moment_a_gap];
    const double stopping = sqrt(creep * creep + 2.0 * a * max2(distance, 0.0));
    return min2(min2(p[P_control_moment_omega_gap], fabs(rate) + a * p[P_control_T_slow]), stopping);
}

/* Modes of the moment control. */
enum { PARKED, GAP, MOMENT, RETRACTING };

static int next_mode(int mode, bool wanted, bool touching, bool home)
{
    if (mode == PARKED)
        return wanted ? GAP : PARKED;
    if (mode == GAP)
        return wanted ? (touching ? MOMENT : GAP) : RETRACTING;
    if (mode == MOMENT)
        return wanted || touching ? MOMENT : RETRACTING;
    return wanted ? GAP : home ? PARKED : RETRACTING;
}

static void moment_tick(const Plant *k, Saved *z, const double *u)
{
    const double *p = k->raw, slope = p[P_control_moment_slope_hat], T = p[P_control_T_slow];
    double *m = z->m;
    const double rotation = z->b.Om < 0.0 ? -1.0 : 1.0, measured = rotation * z->b.y_M;
    const int before = (int)m[M_mode];
    const double way = before == PARKED ? rotation : m[M_direction];
    const double both = encoder(k, z->b.motor[0].th) + encoder(k, z->b.motor[1].th);
    const double theta = way * 0.5 * both, ref = way * m[M_theta_ref];
    const bool still = fabs(z->b.Om) < p[P_control_moment_Omega_still];
    const double M = still ? max2(slope * (theta - m[M_theta_c]), 0.0) : measured;
    const bool home = ref <= 1e-3 * p[P_control_moment_omega_creep] * T;
    const int mode = next_mode(before, u[U_M_set] > p[P_control_moment_M_on],
                               M > p[P_control_moment_M_contact], home);
    const double limit = p[P_control_moment_rate_max];
    if (mode == MOMENT && before < MOMENT)
        m[M_theta_c] = theta - M / slope;
    double rate = 0.0;
    if (mode == GAP)
        rate = crossing(p, m[M_theta_c] - ref, max2(m[M_rate], 0.0));
    else if (mode == MOMENT)
        rate = clip(2.0 * PI * p[P_control_moment_f_c] * (u[U_M_set] - M) / slope, -limit, limit);
    else if (mode == RETRACTING)
        rate = -min2(crossing(p, ref, min2(m[M_rate], 0.0)), max2(ref, 0.0) / T);
    m[M_M_set] = u[U_M_set], m[M_M_meas] = measured, m[M_direction] = way, m[M_mode] = mode;
    m[M_rate] = rate, m[M_sat_rate] = mode == MOMENT && fabs(rate) >= limit;
}

/* One shaft of the position control: returns the current demand. */
static double position(const double *p, double ref, double rate, double theta, double *last,
                       double *speed)
{
    const double T = p[P_control_T_fast], w = 2.0 * PI * p[P_control_position_f_n];
    const double angle = 2.0 * PI * p[P_control_position_f_speed] * T;
    *speed += angle / (1.0 + angle) * ((theta - *last) / T - *speed), *last = theta;
    const double damping = 2.0 * p[P_control_position_zeta] * w;
    const double wanted = w * w * (ref - theta)
                          + damping * (p[P_control_position_c] * rate - *speed);
    const double i_max = p[P_control_position_i_max];
    return clip(p[P_control_position_J_hat] / p[P_control_position_K_hat] * wanted, -i_max, i_max);
}

static void position_tick(const Plant *k, Saved *z, const double *u)
{
    const double *p = k->raw, T = p[P_control_T_fast];
    double *m = z->m;
    const double theta_1 = encoder(k, z->b.motor[0].th), theta_2 = encoder(k, z->b.motor[1].th);
    const double rate = m[M_direction] * m[M_rate];
    m[M_on] = 1.0 - u[U_power_off];
    /* The reference waits while both motors are on their limit. */
    const double push = rate < 0.0 ? -1.0 : 1.0;
    const bool waits = min2(push * m[M_i_1_ref], push * m[M_i_2_ref])
                       >= p[P_control_position_i_max];
    const double next = m[M_theta_ref] + (waits ? 0.0 : rate * T);
    m[M_theta_ref] = m[M_on] > 0.5 ? next : 0.5 * (theta_1 + theta_2);
    m[M_delta] += T / (T + p[P_control_offset_T_change])
                  * (p[P_control_offset_delta_preload] - m[M_delta]);
    const double apart = m[M_delta] / p[P_control_offset_k_hat];
    m[M_theta_1_ref] = m[M_theta_ref] - apart, m[M_theta_2_ref] = m[M_theta_ref] + apart;
    m[M_i_1_ref] = m[M_on] * position(p, m[M_theta_1_ref], rate, theta_1, m + M_last_1,
                                      m + M_speed_1);
    m[M_i_2_ref] = m[M_on] * position(p, m[M_theta_2_ref], rate, theta_2, m + M_last_2,
                                      m + M_speed_2);
}

static Saved start_of(const double *state)
{
    const double *x = state;
    Saved z = {.b = {.motor = {{x[X_demand_1], x[X_sensed_1], x[X_integral_1], x[X_i_1],
                                x[X_theta_1], x[X_omega_1]},
                               {x[X_demand_2], x[X_sensed_2], x[X_integral_2], x[X_i_2],
                                x[X_theta_2], x[X_omega_2]}},
                     .x = x[X_x], .v = x[X_v], .Om = x[X_Omega], .phi = x[X_phi],
                     .y_M = x[X_y_M], .y_P = x[X_y_P]}};
    memcpy(z.m, state + X_COUNT, sizeof z.m);
    return z;
}

static void record_energies(const Plant *k, const Saved *z, double *o)
{
    const Body *b = &z->b;
    const double *e = z->e, way = b->x < 0.0 ? -1.0 : 1.0;
    const double X_1 = k->lead * b->motor[0].th, X_2 = k->lead * b->motor[1].th;
    const double d_1 = b->x - X_1 - k->g_1, d_2 = X_2 - b->x - k->g_2, d_12 = X_1 - X_2 - k->g_12;
    const Heart f = pressed(k, d_1, d_2, d_12);
    const double n = max2(way * b->x * k->tan - k->clear + k->runout * sin(b->phi), 0.0);
    const double near = max2(-k->x_stop - b->x, 0.0), far = max2(b->x - k->x_stop, 0.0);
    const double heart = 0.5 * (f.f_1 * d_1 + f.f_2 * d_2 + f.f_12 * d_12);
    const double caliper = 0.5 * k->K_cal * n * n;
    const double stop = 0.5 * k->k_stop * (near * near + far * far);
    double stored = 0.5 * (k->M_W * b->v * b->v + k->k_return * b->x * b->x);
    stored += heart + caliper + stop;
    for (int j = 0; j < 2; j++) {
        const Motor *s = b->motor + j;
        const MotorPar *q = k->motor + j;
        stored += 0.5 * (q->L * s->i * s->i + q->J * s->om * s->om)
                  + q->T_cog / q->N_cog * (1.0 - cos(q->N_cog * s->th));
    }
    o[O_E_source] = e[E_W_electric] + e[E_W_disc] + e[E_W_runout];
    o[O_E_copper] = e[E_E_copper], o[O_E_damping] = e[E_E_damping], o[O_E_shaft] = e[E_E_shaft];
    o[O_E_wedge] = e[E_E_wedge], o[O_E_heart] = e[E_W_heart] - heart;
    o[O_E_caliper] = e[E_W_caliper] - caliper, o[O_E_stop] = e[E_W_stop] - stop;
    o[O_E_stored] = stored, o[O_U_caliper] = caliper, o[O_W_supply] = e[E_W_supply];
    o[O_W_electric] = e[E_W_electric], o[O_W_disc] = e[E_W_disc], o[O_W_runout] = e[E_W_runout];
    o[O_W_brake] = e[E_W_brake], o[O_t_stuck] = e[E_t_stuck], o[O_derated] = 0.0;
    o[O_E_warming] = o[O_E_winding] = o[O_E_housing] = o[O_E_motor_air] = 0.0;
}

/* What the contacts carry at an instant. */
typedef struct { Heart f; double F_N, F_end; } Carried;

static Carried carried(const Plant *k, const Body *b)
{
    const Motor *a = b->motor, *c = b->motor + 1;
    const double X_1 = k->lead * a->th, X_2 = k->lead * c->th;
    const double r_1 = k->lead * a->om, r_2 = k->lead * c->om;
    const double climb = b->x < 0.0 ? -k->tan : k->tan, ahead = k->tau_stop * b->v;
    const double depth = climb * b->x - k->clear + k->runout * sin(b->phi);
    const double closing = climb * b->v + k->runout * cos(b->phi) * b->Om;
    return (Carried){
        .f = pressed(k, b->x - X_1 - k->g_1 + k->tau * (b->v - r_1),
                     X_2 - b->x - k->g_2 + k->tau * (r_2 - b->v),
                     X_1 - X_2 - k->g_12 + k->tau * (r_1 - r_2)),
        .F_N = k->K_cal * max2(depth + k->tau_cal * closing, 0.0),
        .F_end = k->k_stop * (max2(b->x - k->x_stop + ahead, 0.0)
                              - max2(-k->x_stop - b->x - ahead, 0.0)),
    };
}

static void record(const Plant *k, const Saved *z, double *o)
{
    const Body *b = &z->b;
    const Carried t = carried(k, b);
    const double *m = z->m;
    const Motor *a = b->motor, *c = b->motor + 1;
    const bool on = m[M_on] > 0.5;
    const double V_1 = voltage(k, k->motor, a, on), V_2 = voltage(k, k->motor + 1, c, on);
    o[O_M_set] = m[M_M_set], o[O_M_B] = k->per_F_N * direction_of(k, b->Om) * t.F_N;
    o[O_y_M] = b->y_M, o[O_M_meas] = m[M_M_meas], o[O_mode] = m[M_mode];
    o[O_rate] = m[M_rate], o[O_sat_rate] = m[M_sat_rate];
    o[O_theta_c] = m[M_theta_c], o[O_theta_ref] = m[M_theta_ref];
    o[O_theta_1_ref] = m[M_theta_1_ref], o[O_theta_2_ref] = m[M_theta_2_ref];
    o[O_theta_1] = a->th, o[O_theta_2] = c->th, o[O_omega_1] = a->om, o[O_omega_2] = c->om;
    o[O_i_1_ref] = m[M_i_1_ref], o[O_i_2_ref] = m[M_i_2_ref], o[O_i_1] = a->i, o[O_i_2] = c->i;
    o[O_voltage_1] = V_1, o[O_voltage_2] = V_2, o[O_x] = b->x, o[O_v] = b->v;
    o[O_f_1] = t.f.f_1, o[O_f_2] = t.f.f_2, o[O_f_12] = t.f.f_12;
    o[O_F_M] = t.f.f_2 - t.f.f_1, o[O_F_N] = t.F_N, o[O_F_end] = t.F_end;
    o[O_T_fr_1] = -b->friction[0], o[O_T_fr_2] = -b->friction[1], o[O_F_fr] = -b->friction[2];
    o[O_Omega] = b->Om, o[O_phi] = b->phi;
    o[O_T_winding_1] = o[O_T_winding_2] = k->T_a; /* motors that stay cold */
    o[O_T_housing_1] = o[O_T_housing_2] = k->T_a;
    o[O_clearance] = k->clear, o[O_taken] = 0.0; /* without adjuster */
    o[O_clicks] = o[O_teeth] = o[O_gap_hat] = o[O_adjusting] = o[O_W_adjuster] = 0.0;
    o[O_contacts] = (t.f.f_1 > 0.0) + 2.0 * (t.f.f_2 > 0.0) + 4.0 * (t.f.f_12 > 0.0);
    o[O_stuck] = a->om == 0.0 && c->om == 0.0 && b->v == 0.0;
    o[O_P_in] = k->standby + V_1 * a->i + V_2 * c->i, o[O_P_meas] = b->y_P;
#ifndef WITHOUT_SUMS
    record_energies(k, z, o);
#endif
}
