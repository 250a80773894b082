/* Sampled controllers of the wedge brake: moment (1 kHz) and position (5 kHz); encoder ideal. */
#include <math.h>

static const double PI = 3.14159265358979323846;

typedef struct {
    double on, mode, direction, rate, theta_c, theta_ref, delta, last[2], speed[2], i_ref[2];
} Control;

static double limited(double z, double most) { return z > most ? most : z < -most ? -most : z; }

static double smaller(double a, double b) { return a < b ? a : b; }

static double larger(double a, double b) { return a > b ? a : b; }

/* Speed toward a place `left` away, from the speed `now`: accelerate, cruise, brake, creep. */
static double approach(const Par *P, double left, double now)
{
    double a = P->control_moment_a_gap, creep = P->control_moment_omega_creep;
    double arriving = sqrt(creep * creep + 2.0 * a * larger(left, 0.0));
    double starting = fabs(now) + a * P->control_T_slow;
    return smaller(P->control_moment_omega_gap, smaller(starting, arriving));
}

static void control_moment(const Par *P, Control *c, double M_set, double theta_1, double theta_2,
                           double shown, double Omega)
{
    enum { PARKED, GAP, MOMENT, RETRACTING };
    double turning = Omega < 0.0 ? -1.0 : 1.0, slope = P->control_moment_slope_hat;
    int before = (int)c->mode, mode = before;
    if (before == PARKED) c->direction = turning;
    double theta = c->direction * 0.5 * (theta_1 + theta_2), at = c->direction * c->theta_ref;
    double M = turning * shown;
    if (fabs(Omega) < P->control_moment_Omega_still)
        M = larger(slope * (theta - c->theta_c), 0.0);
    int wanted = M_set > P->control_moment_M_on, touching = M > P->control_moment_M_contact;
    int home = at <= 1e-3 * P->control_moment_omega_creep * P->control_T_slow;
    switch (before) {
    case PARKED: mode = wanted ? GAP : PARKED; break;
    case GAP: mode = !wanted ? RETRACTING : touching ? MOMENT : GAP; break;
    case MOMENT: mode = wanted || touching ? MOMENT : RETRACTING; break;
    default: mode = wanted ? GAP : home ? PARKED : RETRACTING;
    }
    if (mode == MOMENT && before == GAP) c->theta_c = theta - M / slope;
    double rate = 0.0;
    if (mode == GAP) rate = approach(P, c->theta_c - at, larger(c->rate, 0.0));
    if (mode == MOMENT)
        rate = limited(2.0 * PI * P->control_moment_f_c * (M_set - M) / slope,
                       P->control_moment_rate_max);
    if (mode == RETRACTING)
        rate = -smaller(approach(P, at, smaller(c->rate, 0.0)),
                        larger(at, 0.0) / P->control_T_slow);
    c->mode = mode;
    c->rate = rate;
}

static void control_position(const Par *P, Control *c, double power_off, const double theta[2])
{
    double T = P->control_T_fast, w_n = 2.0 * PI * P->control_position_f_n;
    double corner = 2.0 * PI * P->control_position_f_speed * T;
    double k = P->control_offset_k_hat, rate = c->direction * c->rate;
    double F_M = fabs(P->control_position_K_hat * (c->i_ref[0] + c->i_ref[1]) / k);
    double low = P->control_offset_F_low, high = P->control_offset_F_high;
    double share = P->scheduled * limited(larger(F_M - low, 0.0) / (high - low), 1.0);
    double target = P->control_offset_delta_preload * (1.0 - share)
        + P->control_offset_delta_together * share;
    c->delta += T / (T + P->control_offset_T_change) * (target - c->delta);
    c->on = 1.0 - power_off;
    c->theta_ref = c->on > 0.5 ? c->theta_ref + rate * T : 0.5 * (theta[0] + theta[1]);
    for (int m = 0; m < 2; m++) {
        double wanted = c->theta_ref + (m ? c->delta : -c->delta) / k;
        double difference = (theta[m] - c->last[m]) / T;
        c->speed[m] += corner / (1.0 + corner) * (difference - c->speed[m]);
        c->last[m] = theta[m];
        double acceleration = w_n * w_n * (wanted - theta[m])
            + 2.0 * P->control_position_zeta * w_n * (P->control_position_c * rate - c->speed[m]);
        double i = P->control_position_J_hat / P->control_position_K_hat * acceleration;
        c->i_ref[m] = c->on * limited(i, P->control_position_i_max);
    }
}
