/* Wedge brake with Karnopp friction: classical Runge-Kutta of order 4, contacts by enumeration. */

enum { DEMAND, SENSED, INTEGRAL, CURRENT, THETA, SPEED, SIDE }; /* of one motor; then the other */
enum { X = 2 * SIDE, V, OMEGA, PHI, SHOWN, STATES, ROW = STATES + 6 };
enum { SHAFT_1, SHAFT_2, WEDGE, DISC, RUBBING };
static const int WHERE[RUBBING] = { SPEED, SIDE + SPEED, V, OMEGA };

typedef struct {
    double net[RUBBING];  /* forces but friction, on each rubbing body */
    double down[RUBBING]; /* largest friction against positive motion */
    double up[RUBBING];   /* largest friction against negative motion */
    double mass[RUBBING];
    double F_N, M_B, f[3];
} Forces;

static const double TINY = 1e-18; /* m: rounding of an overlap, so that no tie is refused twice */

/* Of motor m. */
#define MOTOR(name) (m ? P->motor_2_##name : P->motor_1_##name)

/* Solve the rows and columns of `set` of C f = d by elimination; 0 where it pulls or overlaps. */
static int presses(const double C[3][3], const double d[3], int set, double f[3])
{
    double A[3][4];
    int row[3], n = 0;
    for (int k = 0; k < 3; k++) {
        f[k] = 0.0;
        if (set & (1 << k)) row[n++] = k;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) A[i][j] = C[row[i]][row[j]];
        A[i][3] = d[row[i]];
    }
    for (int p = 0; p < n; p++)
        for (int i = p + 1; i < n; i++) {
            double part = A[i][p] / A[p][p];
            for (int j = p; j < n; j++) A[i][j] -= part * A[p][j];
            A[i][3] -= part * A[p][3];
        }
    for (int i = n - 1; i >= 0; i--) {
        double right = A[i][3];
        for (int j = i + 1; j < n; j++) right -= A[i][j] * f[row[j]];
        f[row[i]] = right / A[i][i];
        if (f[row[i]] < 0.0) return 0;
    }
    for (int k = 0; k < 3; k++) {
        double air = -d[k];
        for (int j = 0; j < 3; j++) air += C[k][j] * f[j];
        if (!(set & (1 << k)) && air < -TINY) return 0;
    }
    return 1;
}

static void heart(const Par *P, const double y[STATES], double f[3])
{
    double k = P->screw_lead / (2.0 * PI), tau = P->heart_tau_heart, s = 1.0 / P->heart_K_S;
    double w = s + 1.0 / P->heart_K_W, t = 2.0 * s + 1.0 / P->heart_K_C;
    const double C[3][3] = { { w, 0.0, -s }, { 0.0, w, -s }, { -s, -s, t } };
    double X_1 = k * (y[THETA] + tau * y[SPEED]), x = y[X] + tau * y[V];
    double X_2 = k * (y[SIDE + THETA] + tau * y[SIDE + SPEED]);
    const double d[3] = { x - X_1 - P->heart_g_1, X_2 - x - P->heart_g_2,
                          X_1 - X_2 - P->heart_g_12 };
    for (int set = 0; set < 8; set++)
        if (presses(C, d, set, f)) return;
    f[0] = f[1] = f[2] = 1e300; /* never: C is positive definite; no comparison overlooks it */
}

static double bearing(const Par *P, double F, double omega)
{
    double speed = fabs(omega);
    double axial = P->bearing_C_0 + P->bearing_C_1 * fabs(F) + P->bearing_C_2 * F * F;
    double grease = P->bearing_nu / P->bearing_nu_ref * speed / P->bearing_omega_ref;
    double peak = P->bearing_G_S * exp(-P->bearing_k_S * speed / P->bearing_omega_S);
    return axial * (1.0 + peak) + P->bearing_T_nu * pow(grease, P->bearing_k_nu);
}

/* Both filters, PI with tracking, winding; returns the torque of the current. */
static double drive(const Par *P, int m, const double *y, double i_ref, double on, double *rate)
{
    double R = MOTOR(R_ref) * (1.0 + MOTOR(a_R) * MOTOR(dT)), T_t = P->drive_T_t;
    double K_T = MOTOR(K_ref) * (1.0 - MOTOR(a_K) * MOTOR(dT));
    double e = limited(y[DEMAND], P->drive_i_max) - y[SENSED];
    double wanted = P->drive_k_p * e + y[INTEGRAL], duty = limited(wanted, 1.0);
    double V = P->drive_V_dc * duty;
    rate[INTEGRAL] = P->drive_k_i * e + (duty - wanted) / T_t;
    if (on < 0.5) {
        V = K_T * y[SPEED] - P->drive_R_off * y[CURRENT];
        rate[INTEGRAL] = -y[INTEGRAL] / T_t;
    }
    rate[DEMAND] = 2.0 * PI * P->drive_f_demand * (i_ref - y[DEMAND]);
    rate[SENSED] = 2.0 * PI * P->drive_f_sense * (P->drive_G_sense * y[CURRENT] - y[SENSED]);
    rate[CURRENT] = (V - R * y[CURRENT] - K_T * y[SPEED]) / MOTOR(L_M);
    rate[THETA] = y[SPEED];
    return K_T * y[CURRENT];
}

/* Everything but friction: rates of the other states, net forces and largest frictions. */
static void forces(const Par *P, const Control *c, const double y[STATES], double rate[STATES],
                   Forces *g)
{
    double k = P->screw_lead / (2.0 * PI), slope = tan(P->wedge_alpha), r = P->flywheel_runout;
    heart(P, y, g->f);
    const double F[2] = { g->f[0] - g->f[2], g->f[2] - g->f[1] };
    for (int m = 0; m < 2; m++) {
        const double *own = y + m * SIDE;
        double T = drive(P, m, own, c->i_ref[m], c->on, rate + m * SIDE);
        double opposing = (1.0 / P->screw_eta_f - 1.0) * fabs(F[m]) * k;
        double aiding = (1.0 - P->screw_eta_b) * fabs(F[m]) * k;
        double rolling = bearing(P, F[m], own[SPEED]);
        if (P->screw_by_torque) opposing = aiding = (1.0 - P->screw_eta_f) * fabs(T);
        g->net[m] = T - MOTOR(T_cog) * sin(MOTOR(N_cog) * own[THETA]) + k * F[m]
            - MOTOR(D_M) * own[SPEED];
        g->down[m] = rolling + (F[m] < 0.0 ? opposing : aiding);
        g->up[m] = rolling + (F[m] > 0.0 ? opposing : aiding);
        g->mass[m] = MOTOR(J_M);
    }
    double side = y[X] < 0.0 ? -1.0 : 1.0;
    double turning = y[OMEGA] > P->flywheel_Omega_still;
    turning -= y[OMEGA] < -P->flywheel_Omega_still;
    double n = side * y[X] * slope - P->caliper_clearance + r * sin(y[PHI]);
    double closing = side * y[V] * slope + r * cos(y[PHI]) * y[OMEGA];
    g->F_N = P->caliper_K_cal * larger(n + P->caliper_tau_cal * closing, 0.0);
    g->M_B = 2.0 * P->wedge_mu_B * turning * g->F_N * P->caliper_r_B;
    double reach = y[X] + P->stop_tau_stop * y[V];
    double stop = P->stop_k_stop * (larger(-P->wedge_x_stop - reach, 0.0)
                                    - larger(reach - P->wedge_x_stop, 0.0));
    g->net[WEDGE] = g->f[1] - g->f[0] + (P->wedge_mu_B * turning - side * slope) * g->F_N
        - P->wedge_k_return * y[X] + stop;
    g->down[WEDGE] = g->up[WEDGE] = P->wedge_friction_mu_int * (g->f[0] + g->f[1]) * slope
        + P->wedge_friction_mu_R * g->F_N;
    if (P->disc_holds && turning == 0.0)
        g->down[WEDGE] = g->up[WEDGE] += P->wedge_mu_B * g->F_N;
    g->mass[WEDGE] = P->wedge_M_W;
    g->net[DISC] = P->driven * P->flywheel_K_drive * (P->flywheel_Omega_0 - y[OMEGA]);
    g->down[DISC] = g->up[DISC] = 2.0 * P->wedge_mu_B * g->F_N * P->caliper_r_B;
    g->mass[DISC] = P->flywheel_J_F;
    rate[X] = y[V];
    rate[PHI] = y[OMEGA];
    rate[SHOWN] = 2.0 * PI * P->moment_sensor_f_M * (g->M_B - y[SHOWN]);
}

/* Karnopp, for one step: +1 and -1 slide, 0 sticks. Outside the band the speed decides, inside it
 * the other forces do. A speed that has just stepped across the band is as good as within. */
static void choose(const Par *P, const Control *c, const double band[RUBBING],
                   const double before[STATES], double y[STATES], int way[RUBBING])
{
    Forces g;
    double unused[STATES];
    forces(P, c, y, unused, &g);
    for (int k = 0; k < RUBBING; k++) {
        double w = y[WHERE[k]];
        int within = fabs(w) <= band[k] || w * before[WHERE[k]] < 0.0;
        way[k] = (within ? g.net[k] : w) > 0.0 ? 1 : -1;
        if (within && g.net[k] <= g.down[k] && -g.net[k] <= g.up[k]) way[k] = 0;
        if (way[k] == 0) y[WHERE[k]] = 0.0;
    }
}

static void rates(const Par *P, const Control *c, const int way[RUBBING], const double y[STATES],
                  double rate[STATES])
{
    Forces g;
    forces(P, c, y, rate, &g);
    for (int k = 0; k < RUBBING; k++) {
        double friction = way[k] == 0 ? -g.net[k] : way[k] > 0 ? -g.down[k] : g.up[k];
        rate[WHERE[k]] = (g.net[k] + friction) / g.mass[k];
    }
}

static void step(const Par *P, const Control *c, const int way[RUBBING], double h, double y[STATES])
{
    double a[STATES], b[STATES], d[STATES], e[STATES], z[STATES];
    rates(P, c, way, y, a);
    for (int j = 0; j < STATES; j++) z[j] = y[j] + 0.5 * h * a[j];
    rates(P, c, way, z, b);
    for (int j = 0; j < STATES; j++) z[j] = y[j] + 0.5 * h * b[j];
    rates(P, c, way, z, d);
    for (int j = 0; j < STATES; j++) z[j] = y[j] + h * d[j];
    rates(P, c, way, z, e);
    for (int j = 0; j < STATES; j++) y[j] += h / 6.0 * (a[j] + 2.0 * (b[j] + d[j]) + e[j]);
}

/* States, mode and forces at a tick. */
static void record(const Par *P, const Control *c, const double y[STATES], double *row)
{
    Forces g;
    double unused[STATES];
    for (int j = 0; j < STATES; j++) *row++ = y[j];
    *row++ = c->mode;
    forces(P, c, y, unused, &g);
    *row++ = g.F_N;
    *row++ = g.M_B;
    for (int k = 0; k < 3; k++) *row++ = g.f[k];
}

/* Parked and preloaded at first; a row at each fast tick, after the controllers. */
void karnopp_run(const Par *P, const double band[RUBBING], int ticks, int substeps, int ratio,
                 const double *M_set, const double *power_off, double *rows)
{
    double apart = P->control_offset_delta_preload * 2.0 * PI / P->screw_lead;
    double y[STATES] = { 0.0 }, before[STATES] = { 0.0 };
    int way[RUBBING];
    Control c = { .on = 1.0, .direction = P->flywheel_Omega_0 < 0.0 ? -1.0 : 1.0 };
    c.delta = P->control_offset_delta_preload;
    c.theta_c = P->caliper_clearance / tan(P->wedge_alpha) * 2.0 * PI / P->screw_lead;
    c.last[0] = y[THETA] = -apart;
    c.last[1] = y[SIDE + THETA] = apart;
    y[OMEGA] = P->flywheel_Omega_0;
    for (int n = 0; n <= ticks; n++, rows += ROW) {
        const double theta[2] = { y[THETA], y[SIDE + THETA] };
        if (n % ratio == 0) control_moment(P, &c, M_set[n], theta[0], theta[1], y[SHOWN], y[OMEGA]);
        control_position(P, &c, power_off[n], theta);
        record(P, &c, y, rows);
        for (int s = 1; s <= substeps && n < ticks; s++) {
            choose(P, &c, band, before, y, way);
            for (int j = 0; j < STATES; j++) before[j] = y[j];
            step(P, &c, way, P->control_T_fast / substeps, y);
        }
    }
}
