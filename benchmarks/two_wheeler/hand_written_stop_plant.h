/* The two-wheeler: its parameters, its road and tyres, and what a substep knows of them. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define PI 3.14159265358979323846
#define NEWTON 3     /* steps to the rising branch of the adhesion's curve */
#define LEVEL 1e-4   /* least slope there, in slip */
#define LEAST 1e-16  /* floor of roots */
#define CRAWL 0.05   /* of a tyre's low speed: below, recordings fade slip out */
#define INLINE static inline __attribute__((always_inline))

/* Wheels: 0 in front, 1 at the rear. */
typedef struct {
    double x, v, N, phi, phi_rate, om[2], u[2], p[2], p_rate[2], th[2];
} State;
typedef struct { double c1, c2, c3, peak, mu; } Ground; /* mu: at the peak */
typedef struct { double sigma, per_sigma, c_t, v_low, tau_slide; } Tyre;
typedef struct { double mu, u; Ground g; } Limits;
typedef struct { double mu, by_u, by_v, by_w; } Slope; /* w: speed of the tread */
typedef struct { double sine, cosine; } Slopes;
typedef struct { double l, h; } Center;

typedef struct {
    const double *raw;
    double h_s, half, two_h; /* length of a substep, half of it, 2 over it */
    double m, mg, L, l_f, h, h_d, inertia, drag, tau_N, k_g, tau_g;
    double J[2], r[2], C_rr[2], per_p[2], w_p[2], zeta[2];
    Tyre tyre[2];
    Ground first;
    Slopes level;
    double x_change, x_back, ramp;
} Plant;

/* What a run carries from tick to tick. */
typedef struct {
    State x, d; /* d: half of the last increment, it predicts the midpoint */
    double m[M_COUNT], e[E_COUNT], p_ref[2], unsettled, careful;
} Sim;

INLINE double max2(double a, double b) { return a > b ? a : b; }
INLINE double min2(double a, double b) { return a < b ? a : b; }
INLINE double clip(double x, double low, double high) { return min2(max2(x, low), high); }

INLINE State midpoint(const State *s, const State *d)
{
    State y = {s->x + d->x, s->v + d->v, s->N + d->N, s->phi + d->phi, s->phi_rate + d->phi_rate,
               {0}, {0}, {0}, {0}, {0}};
    for (int j = 0; j < 2; j++) {
        y.om[j] = s->om[j] + d->om[j], y.u[j] = s->u[j] + d->u[j], y.p[j] = s->p[j] + d->p[j];
        y.p_rate[j] = s->p_rate[j] + d->p_rate[j], y.th[j] = s->th[j] + d->th[j];
    }
    return y;
}

static State scaled(const State *d, double by)
{
    State y = {by * d->x, by * d->v, by * d->N, by * d->phi, by * d->phi_rate,
               {0}, {0}, {0}, {0}, {0}};
    for (int j = 0; j < 2; j++) {
        y.om[j] = by * d->om[j], y.u[j] = by * d->u[j], y.p[j] = by * d->p[j];
        y.p_rate[j] = by * d->p_rate[j], y.th[j] = by * d->th[j];
    }
    return y;
}

static State state_of(const double *x)
{
    return (State){x[X_x], x[X_v], x[X_N_lag], x[X_phi], x[X_phi_rate],
                   {x[X_omega_f], x[X_omega_r]}, {x[X_u_f], x[X_u_r]}, {x[X_p_f], x[X_p_r]},
                   {x[X_p_rate_f], x[X_p_rate_r]}, {x[X_theta_f], x[X_theta_r]}};
}

static double adhesion(const Ground *g, double slip)
{
    return g->c1 * (1.0 - exp(-g->c2 * slip)) - g->c3 * slip;
}

/* The surface and the slope where so much of the further stretch is. */
static Ground surface(const double *p, double part)
{
    const double grip = p[P_vehicle_road_grip];
    const double *a = p + P_vehicle_road_first_c1, *b = p + P_vehicle_road_further_c1;
    Ground g = {.c1 = grip * (a[0] + part * (b[0] - a[0])), .c2 = a[1] + part * (b[1] - a[1]),
                .c3 = grip * (a[2] + part * (b[2] - a[2]))};
    g.peak = min2(log(g.c1 * g.c2 / g.c3) / g.c2, 1.0), g.mu = adhesion(&g, g.peak);
    return g;
}

static Slopes slope(const double *p, double part)
{
    const double a = p[P_vehicle_road_gradient], b = p[P_vehicle_road_gradient_further];
    const double rise = a + part * (b - a), cosine = 1.0 / sqrt(1.0 + rise * rise);
    return (Slopes){rise * cosine, cosine};
}

INLINE bool on_first(const Plant *k, double x)
{
    return x <= k->x_change || x >= k->x_back + k->ramp;
}

static double share(const Plant *k, double x)
{
    return clip((x - k->x_change) / k->ramp, 0.0, 1.0) - clip((x - k->x_back) / k->ramp, 0.0, 1.0);
}

INLINE Ground ground_at(const Plant *k, double x)
{
    return on_first(k, x) ? k->first : surface(k->raw, share(k, x));
}

INLINE Slopes slopes_at(const Plant *k, double x)
{
    return on_first(k, x) ? k->level : slope(k->raw, share(k, x));
}

/* The factors that depend on the length of a substep, for another one. */
INLINE Plant with_step(const Plant *any, double h)
{
    Plant k = *any;
    k.h_s = h, k.half = 0.5 * h, k.two_h = 2.0 / h;
    return k;
}

static Plant prepare(const double *p, double h)
{
    Plant k = {.raw = p, .m = p[P_vehicle_body_m], .L = p[P_vehicle_body_L]};
    k.mg = k.m * p[P_vehicle_body_g], k.l_f = p[P_vehicle_body_l_f], k.h = p[P_vehicle_body_h];
    k.h_d = k.h - p[P_vehicle_body_h_a], k.inertia = p[P_vehicle_body_inertia];
    k.drag = 0.5 * p[P_vehicle_body_rho] * p[P_vehicle_body_CdA], k.tau_N = p[P_vehicle_body_tau_N];
    k.k_g = p[P_vehicle_ground_k], k.tau_g = p[P_vehicle_ground_tau];
    const int wheel[] = {P_vehicle_front_wheel_J, P_vehicle_rear_wheel_J};
    const int tyre[] = {P_vehicle_front_tyre_sigma, P_vehicle_rear_tyre_sigma};
    const int disc[] = {P_front_disc_faces, P_rear_disc_faces};
    const int circuit[] = {P_front_circuit_f_n, P_rear_circuit_f_n};
    for (int j = 0; j < 2; j++) {
        const double *w = p + wheel[j], *t = p + tyre[j], *b = p + disc[j], *c = p + circuit[j];
        k.J[j] = w[0], k.r[j] = w[1], k.C_rr[j] = w[2];
        k.tyre[j] = (Tyre){t[0], 1.0 / t[0], t[1], t[2], t[3]};
        k.per_p[j] = b[0] * b[1] * b[2] * b[3];
        k.w_p[j] = 2.0 * PI * c[0], k.zeta[j] = c[1];
    }
    k.first = surface(p, 0.0), k.level = slope(p, 0.0);
    k.x_change = p[P_vehicle_road_x_change], k.x_back = p[P_vehicle_road_x_back];
    k.ramp = p[P_vehicle_road_ramp];
    return with_step(&k, h);
}

/* The slip below the peak's at which as much is held as at a slip beyond it. */
static double rising(const Ground *g, double mu)
{
    const double bend = g->c2 * g->c3, below = max2(g->mu - mu, 0.0);
    const double straight = -log(max2(1.0 - mu / g->c1, LEAST)) / g->c2;
    double slip = max2(g->peak - sqrt(2.0 * below / bend + LEAST), straight);
    for (int n = 0; n < NEWTON; n++) {
        const double decay = exp(-g->c2 * slip), left = mu - g->c1 * (1.0 - decay) + g->c3 * slip;
        slip += left / max2(g->c1 * g->c2 * decay - g->c3, LEVEL * bend);
    }
    return min2(slip, g->peak);
}

/* What a tyre can hold at the slip of a speed and that of its tread. */
INLINE Limits limits_of(const Plant *k, int j, Ground g, double v, double v_w)
{
    const double faster = max2(fabs(v), fabs(v_w));
    const double slip = fabs(clip((v - v_w) / (faster > 0.0 ? faster : k->tyre[j].v_low), -1.0, 1.0));
    if (slip <= g.peak)
        return (Limits){g.mu, k->tyre[j].sigma * g.peak, g};
    const double mu = adhesion(&g, slip);
    return (Limits){mu, k->tyre[j].sigma * rising(&g, mu), g};
}

/* Force over load, and how it changes. A tyre that sticks is damped near standstill. */
INLINE Slope force_slope(const Tyre *t, double u, double v, double v_w, const Limits *q)
{
    const double bent = fabs(u) * t->per_sigma;
    Slope f = {copysign(q->mu, u), 0.0, 0.0, 0.0};
    if (!(fabs(u) < q->u))
        return f;
    const double decay = exp(-q->g.c2 * bent);
    const double mu = q->g.c1 * (1.0 - decay) - q->g.c3 * bent;
    if (mu < q->mu)
        f.mu = copysign(mu, u), f.by_u = (q->g.c1 * q->g.c2 * decay - q->g.c3) * t->per_sigma;
    if (fabs(v) < t->v_low) {
        const double angle = PI * fabs(v) / t->v_low, rate = t->c_t * (v - v_w);
        const double fade = 0.5 * (1.0 + cos(angle));
        f.mu += rate * fade, f.by_w = -t->c_t * fade;
        f.by_v = t->c_t * fade - rate * 0.5 * PI / t->v_low * copysign(sin(angle), v);
        if (fabs(f.mu) > q->mu)
            return (Slope){copysign(q->mu, f.mu), 0.0, 0.0, 0.0};
    }
    return f;
}

INLINE Center center(const Plant *k, double phi)
{
    const double sine = sin(phi), cosine = cos(phi);
    return (Center){k->l_f * cosine - k->h * sine, k->h * cosine + k->l_f * sine};
}

/* Half increments of the pitch, for the braking force F and the drag of the substep; y: predicted
 * midpoint, d: its half increment, F_y: the force there. */
INLINE void pitch(const Plant *k, const State *s, const State *y, const State *d, Slopes road,
                  double F_y, double F, double F_d, bool closed, State *o)
{
    const Center at = center(k, y->phi);
    const double turn = k->m * at.l * at.h, rate = y->phi_rate, mass = k->inertia + k->m * at.l * at.l;
    const double weight = k->mg * road.cosine, squares = k->m * (at.l * at.l - at.h * at.h);
    const double by_phi = F_y * at.l + weight * at.h + squares * rate * rate;
    const double by_rate = 2.0 * turn * rate, stiff = closed ? k->k_g * k->L * k->L : 0.0;
    const double torque = F * at.h + F_d * k->h_d - weight * at.l + turn * rate * rate;
    const double known = torque - by_phi * d->phi - by_rate * d->phi_rate
                         - stiff * (s->phi + k->tau_g * s->phi_rate);
    /* phi's half increment is half a step of the mean rate. */
    const double bent = by_phi - stiff;
    o->phi_rate = (known + bent * k->half * s->phi_rate)
                  / (k->two_h * mass - by_rate + stiff * k->tau_g - bent * k->half);
    o->phi = k->half * (s->phi_rate + o->phi_rate);
}

static void record(const Plant *k, const Sim *z, const double *start, double *o)
{
    const State *s = &z->x;
    const double *m = z->m, *e = z->e;
    const Slopes road = slopes_at(k, s->x);
    const Center at = center(k, s->phi);
    const double N_r = max2(s->N, 0.0), N[2] = {k->mg * road.cosine - N_r, N_r};
    const double drag = k->drag * s->v * fabs(s->v), depth = max2(-k->L * s->phi, 0.0);
    double F = 0.0, kinetic = 0.5 * k->m * s->v * s->v + k->mg * (at.h - k->h);
    kinetic += 0.5 * (k->inertia + k->m * at.l * at.l) * s->phi_rate * s->phi_rate;
    const int side = O_v_r - O_v_f; /* outputs of both wheels stand side by side */
    for (int j = 0; j < 2; j++) {
        const Tyre *t = k->tyre + j;
        const double v_w = k->r[j] * s->om[j];
        const Limits q = limits_of(k, j, ground_at(k, s->x - j * k->L), s->v, v_w);
        const double mu = force_slope(t, s->u[j], s->v, v_w, &q).mu;
        const double faster = max2(max2(fabs(s->v), fabs(v_w)), CRAWL * t->v_low);
        o[O_v_f + j * side] = v_w, o[O_omega_f + j] = s->om[j], o[O_u_f + j] = s->u[j];
        o[O_slip_f + j] = (s->v - v_w) / faster, o[O_mu_f + j] = mu, o[O_F_f + j] = N[j] * mu;
        o[O_sliding_f + j] = !(fabs(s->u[j]) < q.u), o[O_N_f + j] = N[j];
        o[O_p_f + j] = s->p[j], o[O_T_f + j] = k->per_p[j] * max2(s->p[j], 0.0);
        o[O_t_locked_f + j] = e[E_t_locked_f + j];
        o[O_E_brake_f + j] = e[E_E_brake_f + j], o[O_E_tyre_f + j] = e[E_E_tyre_f + j];
        F += N[j] * mu, kinetic += 0.5 * k->J[j] * s->om[j] * s->om[j];
    }
    o[O_x] = s->x, o[O_v] = s->v, o[O_a] = (F + drag + k->mg * road.sine) / k->m;
    o[O_support] = k->k_g * max2(-k->L * (s->phi + k->tau_g * s->phi_rate), 0.0);
    o[O_phi] = s->phi, o[O_phi_rate] = s->phi_rate;
    o[O_p_f_ref] = m[M_p_f_ref], o[O_p_r_ref] = m[M_p_r_ref], o[O_v_hat] = m[M_v_hat];
    o[O_slip_f_hat] = m[M_slip_f_hat], o[O_slip_r_hat] = m[M_slip_r_hat];
    o[O_a_hat] = m[M_a_hat], o[O_eta_f] = m[M_eta_f], o[O_abs_f] = m[M_abs_f];
    o[O_abs_r] = m[M_abs_r], o[O_lift] = m[M_lift];
    o[O_phase_f] = m[M_phase_f], o[O_phase_r] = m[M_phase_r];
    const double energy = 0.5 * k->k_g * depth * depth;
    o[O_E_vehicle] = kinetic + energy, o[O_E_ground] = e[E_W_ground] - energy;
    o[O_E_drag] = e[E_E_drag], o[O_E_roll] = e[E_E_roll];
    o[O_W_slope] = e[E_W_slope], o[O_W_pitch] = e[E_W_pitch];
    for (int j = 0; j < 3; j++) { /* brakes that stay cold */
        o[O_T_disc_f + j] = start[X_T_disc_f + j], o[O_T_disc_r + j] = start[X_T_disc_r + j];
        o[O_E_discs + j] = 0.0;
    }
    o[O_E_friction] = o[O_E_air] = 0.0;
}
