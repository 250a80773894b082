/* The wedge brake as most simulations would have it: every dry friction a tanh of the speed, the
 * classical Runge-Kutta method with a fixed step. Same model, constants and controllers as the
 * hand-written C of the implicit scheme; energies and the power measurement are left out.
 *
 * The lines below are replaced by enums P_, X_, M_, U_, E_ and O_ of parameters, state, memory,
 * stimulus, energies and outputs, generated from the model, and by what the schemes share. */
#include "hand_written_wedge_indices.h"
#include "hand_written_wedge_model.h"

/* The states as they are integrated: two motors of six, then wedge, disc, moment sensor. */
enum { S_demand, S_sensed, S_integral, S_i, S_th, S_om, MOTOR, S_x = 2 * MOTOR, S_v, S_Om, S_phi,
       S_y_M, STATES };

/* Constants, and what the controllers hold over a tick; reciprocals instead of divisions. */
typedef struct {
    Plant k;
    double per_om, per_v; /* one over the widths of the tanh */
    double per_L[2], per_J[2], per_M, per_J_F, per_T, i_ref[2];
    bool on;
} Explicit;

INLINE void motor_rate(const Explicit *s, int j, const double *x, double axial, double *rate)
{
    const Plant *k = &s->k;
    const MotorPar *q = k->motor + j;
    const double e = clip(x[S_demand], -k->i_max, k->i_max) - x[S_sensed];
    const double wanted = k->k_p * e + x[S_integral], duty = clip(wanted, -1.0, 1.0);
    const double v = s->on ? k->V * duty : q->K * x[S_om] - k->R_off * x[S_i];
    const Grip grip = shaft_grip(k, axial, x[S_om]);
    const double friction = (x[S_om] > 0.0 ? grip.forward : grip.back) * tanh(x[S_om] * s->per_om);
    const double torque = q->K * x[S_i] - q->T_cog * sin(q->N_cog * x[S_th]) + k->lead * axial
                          - q->D * x[S_om] - friction;
    rate[S_demand] = k->w_d * (s->i_ref[j] - x[S_demand]);
    rate[S_sensed] = k->w_s * (k->G * x[S_i] - x[S_sensed]);
    rate[S_integral] = s->on ? k->k_i * e + (duty - wanted) * s->per_T : -x[S_integral] * s->per_T;
    rate[S_i] = (v - q->R * x[S_i] - q->K * x[S_om]) * s->per_L[j];
    rate[S_th] = x[S_om], rate[S_om] = torque * s->per_J[j];
}

static void derivative(const Explicit *s, const double *x, double *rate)
{
    const Plant *k = &s->k;
    const double *a = x, *b = x + MOTOR, v = x[S_v], Om = x[S_Om];
    const double X_1 = k->lead * (a[S_th] + k->tau * a[S_om]);
    const double X_2 = k->lead * (b[S_th] + k->tau * b[S_om]), y = x[S_x] + k->tau * v;
    const Heart f = pressed(k, y - X_1 - k->g_1, X_2 - y - k->g_2, X_1 - X_2 - k->g_12);
    motor_rate(s, 0, a, f.f_1 - f.f_12, rate), motor_rate(s, 1, b, f.f_12 - f.f_2, rate + MOTOR);
    const double turning = direction_of(k, Om), climb = (x[S_x] < 0.0 ? -1.0 : 1.0) * k->tan;
    const double n = climb * (x[S_x] + k->tau_cal * v) - k->clear
                     + k->runout * (sin(x[S_phi]) + k->tau_cal * cos(x[S_phi]) * Om);
    const double F_N = k->K_cal * max2(n, 0.0), M_B = k->per_F_N * turning * F_N;
    const double at_stop = x[S_x] + k->tau_stop * v;
    const double F_stop = k->k_stop * (max2(at_stop - k->x_stop, 0.0)
                                       - max2(-k->x_stop - at_stop, 0.0));
    const double sliding = (k->mu_int * (f.f_1 + f.f_2) + k->mu_R * F_N) * tanh(v * s->per_v);
    const double force = f.f_2 - f.f_1 + (k->mu_B * turning - climb) * F_N - k->k_return * x[S_x]
                         - F_stop - sliding;
    rate[S_x] = v, rate[S_v] = force * s->per_M;
    rate[S_Om] = -M_B * s->per_J_F, rate[S_phi] = Om, rate[S_y_M] = k->w_M * (M_B - x[S_y_M]);
}

static void step(const Explicit *s, double *x)
{
    const double h = s->k.h, half = s->k.half, sixth = h / 6.0;
    double k1[STATES], k2[STATES], k3[STATES], k4[STATES], y[STATES];
    derivative(s, x, k1);
    for (int i = 0; i < STATES; i++)
        y[i] = x[i] + half * k1[i];
    derivative(s, y, k2);
    for (int i = 0; i < STATES; i++)
        y[i] = x[i] + half * k2[i];
    derivative(s, y, k3);
    for (int i = 0; i < STATES; i++)
        y[i] = x[i] + h * k3[i];
    derivative(s, y, k4);
    for (int i = 0; i < STATES; i++)
        x[i] += sixth * (k1[i] + k4[i] + 2.0 * (k2[i] + k3[i]));
}

/* What the controllers see, from the states as they are integrated. */
static void show(const double *x, Body *b)
{
    memcpy(b->motor, x, sizeof b->motor); /* both in one order */
    b->x = x[S_x], b->v = x[S_v], b->Om = x[S_Om], b->phi = x[S_phi], b->y_M = x[S_y_M];
}

/* One run: frames ticks of the position control of steps steps each. width_om, width_v: of the tanh
 * of the shafts, rad/s, and of the wedge, m/s. rec: a row of wedge travel and shown moment
 * per tick of the moment control. u: frames + 1 rows of stimulus; state: the model's State and
 * Memory at the start. */
void tanh_run(const double *p, double h, int64_t frames, int64_t steps, const double *u,
              const double *state, double width_om, double width_v, double *rec)
{
    Explicit s = {.k = plant_of(p, h)};
    s.per_om = 1.0 / width_om, s.per_v = 1.0 / width_v, s.per_T = 1.0 / s.k.T_t;
    s.per_M = 1.0 / s.k.M_W, s.per_J_F = 1.0 / s.k.J_F;
    for (int j = 0; j < 2; j++)
        s.per_L[j] = 1.0 / s.k.motor[j].L, s.per_J[j] = 1.0 / s.k.motor[j].J;
    const int64_t slow = llround(p[P_control_T_slow] / p[P_control_T_fast]);
    Saved z = start_of(state);
    double x[STATES];
    memcpy(x, z.b.motor, sizeof z.b.motor);
    x[S_x] = z.b.x, x[S_v] = z.b.v, x[S_Om] = z.b.Om, x[S_phi] = z.b.phi, x[S_y_M] = z.b.y_M;
    for (int64_t n = 0; n <= frames; n++) {
        if (n % slow == 0)
            moment_tick(&s.k, &z, u + n * U_COUNT);
        position_tick(&s.k, &z, u + n * U_COUNT);
        if (n % slow == 0)
            *rec++ = z.b.x, *rec++ = z.b.y_M;
        s.i_ref[0] = z.m[M_i_1_ref], s.i_ref[1] = z.m[M_i_2_ref], s.on = z.m[M_on] > 0.5;
        for (int64_t i = 0; n < frames && i < steps; i++)
            step(&s, x);
        show(x, &z.b);
    }
}
