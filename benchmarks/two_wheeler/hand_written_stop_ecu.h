/* The ECU of the two-wheeler: speeds from pulses and accelerometer, slip PI, lift PI. */

typedef struct { double p, integral, lowered; } Demand;

/* Speed of a wheel from the edge that its sensor last saw. */
static double wheel_speed(const double *p, double theta, double om, double *edge, double *age,
                          double *last)
{
    const double T = p[P_ecu_T_s], step = 2.0 * PI / p[P_sensors_encoder_pulses];
    const double angle = step * floor(theta / step);
    const double since = (theta - angle) / max2(fabs(om), p[P_sensors_encoder_omega_min]);
    const double turned = angle - *edge, waited = *age + T;
    const double slowest = 2.0 * PI / p[P_ecu_wheel_speed_pulses] / waited;
    const double fading = clip(*last, -slowest, slowest);
    *edge = angle, *age = turned == 0.0 ? waited : since;
    *last = turned == 0.0 ? fading : turned / max2(waited - since, 1e-3 * T);
    return *last;
}

static double reference_speed(const double *p, double v, double fastest, double a)
{
    const double T = p[P_ecu_T_s], tau = p[P_ecu_vehicle_speed_tau], carried = v - a * T;
    const double drawn = carried + T / (tau + T) * (fastest - carried);
    const bool rolls = carried - fastest < p[P_ecu_vehicle_speed_slip_small] * carried;
    const bool slow = carried < p[P_ecu_vehicle_speed_v_still];
    return max2(slow || rolls ? drawn : carried, 0.0);
}

/* Slip PI; q: its parameters. p_rider, p_most, p_before: demand, what may be lowered, that before. */
static Demand slip_pi(const double *q, double T, double v, double set, double slip,
                      double integral, double p_rider, double p_most, double p_before)
{
    enum { SLIP_SET, OMEGA_C, T_I, T_T, EAGER, V_OFF, V_FALL, V_FIXED, J, R, K };
    const double K_p = q[OMEGA_C] * q[J] * max2(v, q[V_OFF]) / (q[R] * q[K]);
    const double error = set - slip, wanted = K_p * error + integral;
    const double p = clip(wanted, 0.0, max2(p_most, 0.0));
    const double lack = max2(error, 0.0) / max2(set, 1e-9);
    const double eager = p_most < p_rider || v < q[V_FALL] ? 0.0 : q[EAGER];
    const double growth = K_p / q[T_I] * (1.0 + eager * lack) * error + (p - wanted) / q[T_T];
    return (Demand){p, p_before <= 0.0 ? max2(p_rider, 0.0) : integral + T * growth, p < p_most};
}

static Demand lift_pi(const double *q, double T, double a, double integral, double p_rider,
                      double p_most, double p_before)
{
    enum { A_LIM, K_P, T_I, T_T };
    const double error = q[A_LIM] - a, wanted = q[K_P] * error + integral;
    const double p = clip(wanted, 0.0, max2(p_most, 0.0));
    const double growth = q[K_P] / q[T_I] * error + (p - wanted) / q[T_T];
    return (Demand){p, p_before <= 0.0 ? max2(p_rider, 0.0) : integral + T * growth, p < p_most};
}

static void tick(const Plant *k, Sim *z, const double *u)
{
    const double *p = k->raw, T = p[P_ecu_T_s];
    const double *gains[2] = {p + P_ecu_front_slip_slip_set, p + P_ecu_rear_slip_slip_set};
    double *m = z->m;
    const State *s = &z->x;
    const double tread_before[2] = {m[M_tread_f], m[M_tread_r]};
    const double most_before[2] = {m[M_p_f_most], m[M_p_r_most]};
    for (int j = 0; j < 2; j++)
        m[M_tread_f + j] = (j ? p[P_ecu_rear_slip_r_hat] : p[P_ecu_front_slip_r_hat])
            * wheel_speed(p, s->th[j], s->om[j], m + M_edge_f + j, m + M_age_f + j,
                          m + M_omega_f_hat + j);
    const double shown = (m[M_v_last] - s->v) / T
        - p[P_vehicle_body_g] * slopes_at(k, s->x).sine + p[P_sensors_a_offset];
    m[M_a_hat] += T / (p[P_sensors_tau_a] + T) * (shown - m[M_a_hat]);
    const double v = reference_speed(p, m[M_v_hat], max2(m[M_tread_f], m[M_tread_r]), shown);
    m[M_v_hat] = v, m[M_v_last] = s->v;
    const double alpha = p[P_ecu_mix_alpha], rise = p[P_ecu_p_rate] * T;
    for (int j = 0; j < 2; j++) {
        const double *q = gains[j], tread = m[M_tread_f + j], set_u = u[U_p_f_set + j];
        const double slip = (v - tread) / max2(v, q[5]), set = q[0] * min2(v / q[6], 1.0);
        m[M_slip_f_hat + j] = slip, m[M_p_f_most + j] = min2(set_u, m[M_p_f_most + j] + rise);
        const double seen = (tread_before[j] - tread) / (T * p[P_ecu_mix_g]);
        m[M_eta_f + j] += T / (p[P_ecu_mix_tau] + T) * (seen - m[M_eta_f + j]);
        const Demand out = slip_pi(q, T, v, alpha * set + (1.0 - alpha) * p[P_ecu_mix_eta_set],
                                   alpha * slip + (1.0 - alpha) * m[M_eta_f + j],
                                   m[M_slip_f_integral + j], set_u, m[M_p_f_most + j],
                                   most_before[j]);
        z->p_ref[j] = out.p, m[M_slip_f_integral + j] = out.integral, m[M_abs_f + j] = out.lowered;
    }
    const Demand out = lift_pi(p + P_ecu_front_lift_a_lim, T, m[M_a_hat], m[M_lift_integral],
                               u[U_p_f_set], z->p_ref[0], most_before[0]);
    z->p_ref[0] = out.p, m[M_lift_integral] = out.integral, m[M_lift] = out.lowered;
    m[M_p_f_ref] = z->p_ref[0], m[M_p_r_ref] = z->p_ref[1];
}
