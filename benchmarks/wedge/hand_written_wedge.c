/* The wedge brake, written by hand for this one brake, its default choices and one time-stepping
 * scheme: the yardstick for bywire's kernels.
 *
 * Fully iterated implicit midpoint: contacts by an active set, bounds of the frictions, cogging and
 * saturations at the midpoint of the same substep, frictions that oppose what moves and hold what
 * rests as far as they can, substeps cut where a velocity passes zero. Unknowns are the velocities of both shafts and of the wedge; currents and
 * drives are eliminated on paper, see struct Winding, and the disc is so heavy that it follows.
 *
 * The lines below are replaced by enums P_, X_, M_, U_, E_ and O_ of parameters, state, memory,
 * stimulus, energies and outputs, generated from the model, and by what the schemes share. */
#include "hand_written_wedge_indices.h"
#include "hand_written_wedge_model.h"

#define CAP 20     /* passes after which a substep that does not settle is let go */
#define SIGN_CAP 8 /* changes of the signs of the frictions before all are tried */
#define SPEEDS 3   /* shaft 1, shaft 2, wedge */
#define TURNING 4  /* and the disc */
#define CUTS 10    /* of a substep, after which it is let go */
#define TRIES 12   /* lengths tried to find where a velocity passes zero */
#define CLOSE 1e-12 /* share of a velocity's change that counts as zero there */
#define EDGE 1e-9  /* least share of a part that is cut off or left */
#define STILL 1e-9 /* share of its speed below which another velocity stops at the same instant */
/* Change of the shafts' speeds from pass to pass, rad/s, at which a substep has settled. With 1e-12
 * the wedge's travel in Fig. 7 differs by 4e-15 m rms, and a run takes 2.7 passes and half as much
 * time again; the step's own error is 2e-10 m. */
#ifndef SETTLED
#define SETTLED 1e-6
#endif

/* Drive and winding of one motor over a substep, in terms of the speed om at the midpoint:
 *     i = alpha - beta om
 * The filter of the demand, which nothing feeds back to, is solved before; filter of the current
 * and integral part are put into the winding's equation. Saturated, the voltage is +V or -V. */
enum { LINEAR, SATURATED, OFF, BRANCHES };
typedef struct {
    double pivot[BRANCHES], beta[BRANCHES], inertia[BRANCHES]; /* inertia: 2 J/h + D + K beta */
    double L2, J2;                                             /* 2 L/h, 2 J/h */
} Winding;

/* The heart with the contacts of one of its eight subsets: forces K d of overlaps d, and what their
 * stiffness and damping add to the matrix of the speeds; both symmetric: 11 12 13 22 23 33. */
typedef struct { double K[6], A[6]; } Subset;

/* Matrix of the end-of-step speeds S w = c + friction for the contacts and branches of a key, and
 * its inverse for the speeds that slip, with rows of zeros for the others. Both are kept while they
 * hold, most of the time. */
typedef struct {
    int key, slipping;
    double S[SPEEDS][SPEEDS], N[SPEEDS][SPEEDS];
} Solver;

typedef struct {
    Plant k;
    Winding wind[2];
    Subset subset[8];
    double keep_d, feed_d, keep_s, feed_s, per_e, unwound; /* filters and integral part */
    double reach, reach_cal, reach_stop;                   /* h/2 + tau of the contacts */
    double M2, per_J_F;                                    /* 2 M_W/h, h/J_F */
} Scheme;

/* Sums over the substeps of a tick at their midpoints; constant factors wait for its end. */
typedef struct {
    double vi, disc, runout, brake, ii[2], oo[2], shaft, wedge, heart, caliper, stop, stuck;
} Sums;

typedef struct {
    Body b;
    double d[SPEEDS], dOm; /* half of the last increments: they predict the midpoint */
    int sign[SPEEDS], branch[2];
    double side[2]; /* +1 or -1 where saturated */
    Solver solver;
    Sums sum;
    double unsettled, passes;
} Sim;

/* What acts at one guess of the midpoint. */
typedef struct {
    Heart f;
    double F_N, n_0, near, far, way, turning, Om; /* n_0: caliper's overlap without speed */
    int active; /* bits: heart 1, 2, 4, caliper 8, stops 16, 32 */
} Touch;

static Scheme prepare(const double *p, double h)
{
    Scheme s = {.k = plant_of(p, h)};
    const Plant *k = &s.k;
    const double half = k->half, tau = half + k->tau;
    const double a_d = half * k->w_d, a_s = half * k->w_s;
    s.keep_d = 1.0 / (1.0 + a_d), s.feed_d = a_d * s.keep_d;
    s.keep_s = 1.0 / (1.0 + a_s), s.feed_s = a_s * k->G * s.keep_s;
    s.per_e = k->k_p + half * k->k_i, s.unwound = 1.0 / (1.0 + half / k->T_t);
    for (int j = 0; j < 2; j++) {
        const MotorPar *q = k->motor + j;
        Winding *w = s.wind + j;
        w->L2 = 2.0 * q->L / h, w->J2 = 2.0 * q->J / h;
        w->pivot[LINEAR] = 1.0 / (w->L2 + q->R + k->V * s.per_e * s.feed_s);
        w->pivot[SATURATED] = 1.0 / (w->L2 + q->R);
        w->pivot[OFF] = 1.0 / (w->L2 + q->R + k->R_off);
        for (int n = 0; n < BRANCHES; n++) {
            w->beta[n] = n == OFF ? 0.0 : q->K * w->pivot[n];
            w->inertia[n] = w->J2 + q->D + q->K * w->beta[n];
        }
    }
    /* Forces for unit overlaps with a subset given, and B' K B with the rates of the overlaps B. */
    const double B[3][3] = {{-k->lead, 0, 1}, {0, k->lead, -1}, {k->lead, -k->lead, 0}};
    for (int n = 0; n < 8; n++) {
        const int one = n & 1, two = n >> 1 & 1, tips = n >> 2;
        const double share = k->s * k->W, q = tips ? k->q[one + two] : 0.0;
        const double r[3] = {one ? share : 0.0, two ? share : 0.0, tips ? 1.0 : 0.0};
        double K[3][3] = {{0}}, A[3][3] = {{0}};
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                K[i][j] = q * r[i] * r[j] + (i == j && i < 2 && n >> i & 1 ? k->W : 0.0);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                for (int a = 0; a < 3; a++)
                    for (int b = 0; b < 3; b++)
                        A[i][j] += tau * B[a][i] * K[a][b] * B[b][j];
        for (int i = 0, at = 0; i < 3; i++)
            for (int j = i; j < 3; j++, at++)
                s.subset[n].K[at] = K[i][j], s.subset[n].A[at] = A[i][j];
    }
    s.reach = tau, s.reach_cal = half + k->tau_cal, s.reach_stop = half + k->tau_stop;
    s.M2 = 2.0 * k->M_W / h, s.per_J_F = h / k->J_F;
    return s;
}

INLINE Heart pushed(const Subset *n, double d_1, double d_2, double d_12)
{
    const double *K = n->K;
    return (Heart){.f_1 = K[0] * d_1 + K[1] * d_2 + K[2] * d_12,
                   .f_2 = K[1] * d_1 + K[3] * d_2 + K[4] * d_12,
                   .f_12 = K[2] * d_1 + K[4] * d_2 + K[5] * d_12};
}

/* Overlaps and forces at a midpoint with speeds u; runout with its rate times tau. */
INLINE Touch touch(const Scheme *s, const Body *b, const double *u, double Om, double runout)
{
    const Plant *k = &s->k;
    const double r_1 = k->lead * u[0], r_2 = k->lead * u[1], v = u[2];
    const double X_1 = k->lead * b->motor[0].th, X_2 = k->lead * b->motor[1].th;
    Touch t = {.Om = Om, .turning = direction_of(k, Om)};
    t.f = pressed(k, b->x - X_1 - k->g_1 + s->reach * (v - r_1),
                  X_2 - b->x - k->g_2 + s->reach * (r_2 - v),
                  X_1 - X_2 - k->g_12 + s->reach * (r_1 - r_2));
    const double x = b->x + k->half * v;
    t.way = x < 0.0 ? -1.0 : 1.0;
    t.n_0 = t.way * k->tan * b->x - k->clear + runout;
    t.F_N = k->K_cal * max2(t.n_0 + t.way * k->tan * s->reach_cal * v, 0.0);
    t.active = (t.f.f_1 > 0.0) | (t.f.f_2 > 0.0) << 1 | (t.f.f_12 > 0.0) << 2 | (t.F_N > 0.0) << 3;
    if (fabs(x) + k->tau_stop * fabs(v) > k->x_stop) {
        t.near = k->k_stop * max2(-k->x_stop - x - k->tau_stop * v, 0.0);
        t.far = k->k_stop * max2(x - k->x_stop + k->tau_stop * v, 0.0);
        t.active |= (t.near > 0.0) << 4 | (t.far > 0.0) << 5;
    }
    return t;
}

/* Renew the matrix for contacts and branches. */
static void assemble(const Scheme *s, Solver *z, const Touch *t, const int *branch)
{
    const Plant *k = &s->k;
    const double *A = s->subset[t->active & 7].A;
    double wedge = s->M2 + A[5] + k->k_return * k->half;
    if (t->active & 8) {
        const double climb = t->way * k->tan;
        wedge += k->K_cal * climb * s->reach_cal * (climb - k->mu_B * t->turning);
    }
    wedge += ((t->active >> 4 & 1) + (t->active >> 5 & 1)) * k->k_stop * s->reach_stop;
    z->S[0][0] = 0.5 * (s->wind[0].inertia[branch[0]] + A[0]);
    z->S[1][1] = 0.5 * (s->wind[1].inertia[branch[1]] + A[3]), z->S[2][2] = 0.5 * wedge;
    z->S[0][1] = z->S[1][0] = 0.5 * A[1], z->S[0][2] = z->S[2][0] = 0.5 * A[2];
    z->S[1][2] = z->S[2][1] = 0.5 * A[4];
    z->slipping = -1;
}

/* Inverse of the rows and columns of S that slip, zeros elsewhere. */
static void invert(Solver *z, int slipping)
{
    double A[SPEEDS][SPEEDS], (*N)[SPEEDS] = z->N;
    for (int i = 0; i < SPEEDS; i++)
        for (int j = 0; j < SPEEDS; j++)
            A[i][j] = (slipping >> i & slipping >> j & 1) ? z->S[i][j] : i == j;
    N[0][0] = A[1][1] * A[2][2] - A[1][2] * A[2][1];
    N[0][1] = N[1][0] = A[1][2] * A[2][0] - A[1][0] * A[2][2];
    N[0][2] = N[2][0] = A[1][0] * A[2][1] - A[1][1] * A[2][0];
    N[1][1] = A[0][0] * A[2][2] - A[0][2] * A[2][0];
    N[1][2] = N[2][1] = A[0][1] * A[2][0] - A[0][0] * A[2][1];
    N[2][2] = A[0][0] * A[1][1] - A[0][1] * A[1][0];
    const double r = 1.0 / (A[0][0] * N[0][0] + A[0][1] * N[0][1] + A[0][2] * N[0][2]);
    for (int i = 0; i < SPEEDS; i++)
        for (int j = 0; j < SPEEDS; j++)
            N[i][j] = slipping >> i & 1 ? r * N[i][j] : 0.0;
    z->slipping = slipping;
}

INLINE double row(const double A[SPEEDS], const double *w)
{
    return A[0] * w[0] + A[1] * w[1] + A[2] * w[2];
}

/* Speeds and friction forces for given signs; return whether those of what rests come out as given,
 * and change them toward what came out. */
INLINE bool slide(const Solver *z, const double *start, const double *c, const double (*bound)[2],
                  int *sign, double *w, double *force)
{
    double b[SPEEDS];
    bool right = true;
    for (int i = 0; i < SPEEDS; i++)
        b[i] = c[i] + (sign[i] ? bound[i][sign[i] < 0] : 0.0);
    for (int i = 0; i < SPEEDS; i++)
        w[i] = row(z->N[i], b);
    for (int i = 0; i < SPEEDS; i++) {
        if (sign[i]) {
            force[i] = bound[i][sign[i] < 0];
            if (start[i] == 0.0 && w[i] * sign[i] <= 0.0)
                sign[i] = 0, right = false;
        } else {
            force[i] = row(z->S[i], w) - c[i];
            sign[i] = force[i] < bound[i][0] ? 1 : force[i] > bound[i][1] ? -1 : 0;
            right &= sign[i] == 0;
        }
    }
    return right;
}

/* Project the frictions: what moves keeps its sign, that of what rests is found, beginning with the
 * pass before. */
static bool project(Solver *z, const double *start, const double *c, const double (*bound)[2],
                    int *sign, double *w, double *force)
{
    for (int n = 0; n < SIGN_CAP + 27; n++) {
        const int all = n - SIGN_CAP;
        if (all >= 0) /* they go in circles: try every combination */
            sign[0] = all % 3 - 1, sign[1] = all / 3 % 3 - 1, sign[2] = all / 9 - 1;
        for (int i = 0; i < SPEEDS; i++)
            sign[i] = start[i] > 0.0 ? 1 : start[i] < 0.0 ? -1 : sign[i];
        const int slipping = !!sign[0] | !!sign[1] << 1 | !!sign[2] << 2;
        if (z->slipping != slipping)
            invert(z, slipping);
        if (slide(z, start, c, bound, sign, w, force))
            return true;
    }
    return false;
}

/* One motor over a substep: what does not change from pass to pass. */
typedef struct { double demand, D, q_s, alpha; } Given;

INLINE Given given(const Scheme *s, const Winding *w, const Motor *m, double i_ref, int branch,
                   double side)
{
    const Plant *k = &s->k;
    Given g = {.demand = s->keep_d * m->demand + s->feed_d * i_ref};
    g.D = clip(g.demand, -k->i_max, k->i_max), g.q_s = s->keep_s * m->sensed;
    const double duty = branch == LINEAR ? m->integral + s->per_e * (g.D - g.q_s)
                                         : branch == SATURATED ? side : 0.0;
    g.alpha = w->pivot[branch] * (w->L2 * m->i + k->V * duty);
    return g;
}

/* Midpoint of drive and winding at the midpoint's speed. */
typedef struct { double i, sensed, integral, v, side; int branch; } Drive;

INLINE Drive drive(const Scheme *s, int j, const Motor *m, const Given *g, int branch, double side,
                   double om)
{
    const Plant *k = &s->k;
    const Winding *w = s->wind + j;
    Drive q = {.i = g->alpha - w->beta[branch] * om, .side = side, .branch = branch};
    q.sensed = g->q_s + s->feed_s * q.i;
    if (branch == OFF) {
        q.integral = s->unwound * m->integral, q.v = k->motor[j].K * om - k->R_off * q.i;
        return q;
    }
    const double e = g->D - q.sensed;
    q.integral = m->integral + k->half * k->k_i * e;
    if (branch == SATURATED)
        q.integral = s->unwound * (q.integral + k->half / k->T_t * (side - k->k_p * e));
    const double wanted = k->k_p * e + q.integral;
    q.branch = fabs(wanted) > 1.0 ? SATURATED : LINEAR, q.side = wanted < 0.0 ? -1.0 : 1.0;
    q.v = k->V * (branch == SATURATED ? side : wanted);
    return q;
}

/* Right-hand side c of the speeds' equations: the matrix, half of it for the start and half for the
 * end of the substep, and what acts without speeds. */
INLINE void right_side(const Scheme *s, const Sim *z, const Touch *t, const Given *g,
                       const double *u, double *c)
{
    const Plant *k = &s->k;
    const Body *b = &z->b;
    const double X_1 = k->lead * b->motor[0].th, X_2 = k->lead * b->motor[1].th;
    const Heart f = pushed(s->subset + (t->active & 7), b->x - X_1 - k->g_1, X_2 - b->x - k->g_2,
                           X_1 - X_2 - k->g_12);
    const double pull[2] = {f.f_1 - f.f_12, f.f_12 - f.f_2};
    const double w[SPEEDS] = {b->motor[0].om, b->motor[1].om, b->v};
    for (int j = 0; j < 2; j++) {
        const MotorPar *q = k->motor + j;
        const double cogging = q->T_cog * sin(q->N_cog * (b->motor[j].th + k->half * u[j]));
        c[j] = s->wind[j].J2 * w[j] + q->K * g[j].alpha - cogging + k->lead * pull[j];
    }
    c[2] = s->M2 * b->v + f.f_2 - f.f_1 - k->k_return * b->x;
    if (t->active & 8)
        c[2] += (k->mu_B * t->turning - t->way * k->tan) * k->K_cal * t->n_0;
    if (t->active & 16)
        c[2] += k->k_stop * (-k->x_stop - b->x);
    if (t->active & 32)
        c[2] -= k->k_stop * (b->x - k->x_stop);
    for (int i = 0; i < SPEEDS; i++)
        c[i] -= row(z->solver.S[i], w);
}

/* Add up the powers over a part, as a share of a substep. */
INLINE void book(const Scheme *s, Sim *z, const Touch *t, const double *u, const Drive *q,
                 const double *force, double climb, double share)
{
    const Plant *k = &s->k;
    Sums *a = &z->sum;
    const double r_1 = k->lead * u[0], r_2 = k->lead * u[1], push = t->F_N * u[2];
    for (int j = 0; j < 2; j++) {
        a->vi += share * (q[j].v * q[j].i), a->ii[j] += share * (q[j].i * q[j].i);
        a->oo[j] += share * (u[j] * u[j]), a->shaft -= share * (force[j] * u[j]);
    }
    a->wedge -= share * (force[2] * u[2]), a->disc += share * (t->turning * push);
    a->runout += share * (t->F_N * climb), a->caliper += share * (t->way * push);
    a->stop += share * ((t->far - t->near) * u[2]), a->brake -= share * (force[3] * t->Om);
    const double heart = t->f.f_1 * (u[2] - r_1) + t->f.f_2 * (r_2 - u[2])
                         + t->f.f_12 * (r_1 - r_2);
    a->heart += share * heart;
    a->stuck += u[0] == 0.0 && u[1] == 0.0 && u[2] == 0.0 ? share : 0.0;
}

/* Take over the end of the substep: twice the midpoint less the start, speeds as they are. */
INLINE void commit(const Scheme *s, Sim *z, const Touch *t, const double *w, const double *u,
                   const Given *g, const Drive *q, const double *force, double Om)
{
    const Plant *k = &s->k;
    Body *b = &z->b;
    for (int j = 0; j < 2; j++) {
        Motor *m = b->motor + j;
        z->d[j] = u[j] - m->om;
        m->demand = 2.0 * g[j].demand - m->demand, m->sensed = 2.0 * q[j].sensed - m->sensed;
        m->integral = 2.0 * q[j].integral - m->integral, m->i = 2.0 * q[j].i - m->i;
        m->th += k->h * u[j], m->om = w[j];
    }
    z->d[2] = u[2] - b->v, b->x += k->h * u[2], b->v = w[2];
    z->dOm = t->Om - b->Om, b->phi += k->h * t->Om, b->Om = Om;
    const double M_B = k->per_F_N * t->turning * t->F_N;
    b->y_M += k->h * k->w_M / (1.0 + k->half * k->w_M) * (M_B - b->y_M);
#ifndef WITHOUT_SUMS
    const double power = k->standby + q[0].v * q[0].i + q[1].v * q[1].i;
    b->y_P += k->h / (k->tau_P + k->half) * (power - b->y_P);
#endif
    memcpy(b->friction, force, sizeof b->friction);
}

/* One pass: speeds w and midpoints u from what acts at the midpoint that the one before gave. */
INLINE bool solve(const Scheme *s, Sim *z, const Touch *t, const Given *g, double *u, double *w,
                  double *force)
{
    const Plant *k = &s->k;
    const Body *b = &z->b;
    const double axial[2] = {t->f.f_1 - t->f.f_12, t->f.f_12 - t->f.f_2};
    const double sliding = k->mu_int * (t->f.f_1 + t->f.f_2) + k->mu_R * t->F_N;
    double c[SPEEDS], bound[SPEEDS][2] = {[2] = {-sliding, sliding}};
    for (int j = 0; j < 2; j++) {
        const Grip grip = shaft_grip(k, axial[j], u[j]);
        bound[j][0] = -grip.forward, bound[j][1] = grip.back;
    }
    const int key = (((t->active * BRANCHES + z->branch[0]) * BRANCHES + z->branch[1]) * 3
                     + (int)t->turning + 1) * 2 + (t->way > 0.0);
    if (z->solver.key != key)
        assemble(s, &z->solver, t, z->branch), z->solver.key = key;
    right_side(s, z, t, g, u, c);
    const double start[SPEEDS] = {b->motor[0].om, b->motor[1].om, b->v};
    const bool found = project(&z->solver, start, c, bound, z->sign, w, force);
    u[0] = 0.5 * (b->motor[0].om + w[0]), u[1] = 0.5 * (b->motor[1].om + w[1]);
    u[2] = 0.5 * (b->v + w[2]);
    return found;
}

/* Speed of the disc at the end: the pads' friction slows it down, and holds it at rest. */
INLINE double slowed(const Scheme *s, double Om, double F_N)
{
    return Om == 0.0 ? 0.0 : Om - copysign(s->per_J_F * s->k.per_F_N * F_N, Om);
}

INLINE double *speed_of(Sim *z, int n)
{
    return n < 2 ? &z->b.motor[n].om : n == 2 ? &z->b.v : &z->b.Om;
}

/* The first velocity that changes its sign between two states, -1 if none does, and when. */
INLINE int first_turn(Sim *from, Sim *to, double *share)
{
    int first = -1;
    *share = 1.0;
    for (int n = 0; n < TURNING; n++) {
        const double v = *speed_of(from, n), w = *speed_of(to, n);
        if (v * w < 0.0 && v / (v - w) <= *share)
            *share = v / (v - w), first = n;
    }
    return first;
}

/* A part of a substep, as a share of it; a whole one is not taken over where a velocity turns.
 * Return whether it was. */
static bool part(const Scheme *s, Sim *z, const double *i_ref, bool on, double share, bool whole)
{
    const Plant *k = &s->k;
    Body *b = &z->b;
    double u[SPEEDS] = {b->motor[0].om + z->d[0], b->motor[1].om + z->d[1], b->v + z->d[2]};
    double w[SPEEDS], force[SPEEDS + 1], Om_end;
    /* The speed of the disc is known to 1e-8 of itself beforehand: the run-out is that of the
     * predicted phase to the last digit. */
    const double Om = b->Om + z->dOm, phi = b->phi + k->half * Om;
    const double climb = k->runout * cos(phi) * Om;
    const double runout = k->runout * sin(phi) + k->tau_cal * climb;
    Given g[2];
    for (int j = 0; j < 2; j++) {
        z->branch[j] = !on ? OFF : z->branch[j] == OFF ? LINEAR : z->branch[j];
        g[j] = given(s, s->wind + j, b->motor + j, i_ref[j], z->branch[j], z->side[j]);
    }
    Touch t = touch(s, b, u, Om, runout);
    Drive q[2];
    for (int pass = 1;; pass++) {
        const double guess[SPEEDS] = {u[0], u[1], u[2]};
        const Touch before = t;
        bool settled = solve(s, z, &before, g, u, w, force);
        Om_end = slowed(s, b->Om, before.F_N);
        t = touch(s, b, u, 0.5 * (b->Om + Om_end), runout);
        settled &= t.active == before.active && t.way == before.way && t.turning == before.turning;
        settled &= fabs(u[0] - guess[0]) + fabs(u[1] - guess[1]) < SETTLED
                   && fabs(u[2] - guess[2]) < SETTLED * k->lead;
        for (int j = 0; j < 2; j++) {
            q[j] = drive(s, j, b->motor + j, g + j, z->branch[j], z->side[j], u[j]);
            const bool other = q[j].branch == SATURATED && q[j].side != z->side[j];
            if (other || q[j].branch != z->branch[j]) {
                z->branch[j] = q[j].branch, z->side[j] = q[j].side, settled = false;
                g[j] = given(s, s->wind + j, b->motor + j, i_ref[j], z->branch[j], z->side[j]);
            }
        }
        if (settled || pass == CAP) {
            z->unsettled += !settled, z->passes += pass;
            break;
        }
    }
    if (whole && (b->motor[0].om * w[0] < 0.0 || b->motor[1].om * w[1] < 0.0 || b->v * w[2] < 0.0
                  || b->Om * Om_end < 0.0))
        return false;
    force[SPEEDS] = (Om_end - b->Om) / s->per_J_F;
#ifndef WITHOUT_SUMS /* compiled out for who records no energy */
    book(s, z, &t, u, q, force, climb, share);
#endif
    commit(s, z, &t, w, u, g, q, force, Om_end);
    return true;
}

static void stretch(Sim *z, double by)
{
    z->d[0] *= by, z->d[1] *= by, z->d[2] *= by, z->dOm *= by;
}

/* Where a part of length t leads to from z. */
static Sim tried(const Scheme *s, const Sim *z, const double *i_ref, bool on, double t)
{
    const Scheme own = prepare(s->k.raw, t);
    Sim y = *z;
    y.solver.key = -1;
    stretch(&y, t / s->k.h);
    part(&own, &y, i_ref, on, t / s->k.h, false);
    return y;
}

/* Shorten a part of length *t to the first instant at which a velocity is zero, by the parabola
 * through three lengths, within what is known to lie before and behind. y is where *t leads to,
 * before and behind. Return which velocity it is. */
static int shorten(const Scheme *s, Sim *z, Sim *y, const double *i_ref, bool on, double *t)
{
    const double first = EDGE * *t, final = (1.0 - EDGE) * *t;
    double share, low = 0.0, high = *t, P = 0.0, Q = *t;
    int turns = first_turn(z, y, &share);
    double at_P = *speed_of(z, turns), at_Q = *speed_of(y, turns), N = *t * share;
    double close = CLOSE * fabs(at_P - at_Q);
    for (int n = 1;; n++) {
        N = clip(N, first, final);
        *y = tried(s, z, i_ref, on, N);
        const int other = first_turn(z, y, &share);
        if (other >= 0 && other != turns && n < TRIES) { /* it is earlier */
            turns = other, low = P = 0.0, high = Q = N, N *= share;
            at_P = *speed_of(z, turns), at_Q = *speed_of(y, turns);
            close = CLOSE * fabs(at_P - at_Q);
            continue;
        }
        const double at_N = *speed_of(y, turns);
        if (fabs(at_N) <= close || N <= first || N >= final || N == P || N == Q || n == TRIES)
            break;
        if (at_N * *speed_of(z, turns) > 0.0)
            low = N;
        else
            high = N;
        const double slope = (at_N - at_P) / (N - P) + (at_N - at_Q) / (N - Q)
                             - (at_Q - at_P) / (Q - P);
        const double next = N - at_N / slope;
        if (fabs(P - next) > fabs(Q - next))
            P = N, at_P = at_N;
        else
            Q = N, at_Q = at_N;
        N = next > low && next < high ? next : 0.5 * (low + high);
    }
    *t = N;
    return turns;
}

static void substep(const Scheme *s, Sim *z, const double *i_ref, bool on)
{
    if (__builtin_expect(part(s, z, i_ref, on, 1.0, true), 1))
        return;
    double left = s->k.h, share;
    Sim from = *z, y = tried(s, z, i_ref, on, left);
    for (int cuts = 0;; cuts++) {
        if (first_turn(&from, &y, &share) < 0)
            break;
        if (cuts == CUTS) {
            y.unsettled += 1.0;
            break;
        }
        double t = left;
        const int turns = shorten(s, &from, &y, i_ref, on, &t);
        stretch(&y, s->k.h / t);
        for (int k = 0; k <= SPEEDS; k++)
            if (k == turns || fabs(*speed_of(&y, k)) < STILL * fabs(*speed_of(&from, k))) {
                *speed_of(&y, k) = 0.0;
                k < SPEEDS ? (y.d[k] = 0.0) : (y.dOm = 0.0);
            }
        from = y, left -= t;
        y = tried(s, &from, i_ref, on, left);
    }
    *z = y;
    stretch(z, s->k.h / left);
    z->solver.key = -1;
}

/* The substeps of one tick, and the energies that they add up to. */
static void frame(const Scheme *s, Sim *z, Saved *saved, int64_t steps)
{
    const Plant *k = &s->k;
    const double *m = saved->m, h = k->h, i_ref[2] = {m[M_i_1_ref], m[M_i_2_ref]};
    const bool on = m[M_on] > 0.5;
    z->sum = (Sums){0};
    for (int64_t n = 0; n < steps; n++)
        substep(s, z, i_ref, on);
    saved->b = z->b;
    const Sums *a = &z->sum;
    const MotorPar *q = k->motor;
    double *e = saved->e;
    e[E_W_electric] += h * a->vi, e[E_W_supply] += h * (a->vi + steps * k->standby);
    e[E_W_disc] += h * k->mu_B * a->disc, e[E_W_runout] += h * a->runout;
    e[E_W_brake] += h * a->brake, e[E_E_copper] += h * (q[0].R * a->ii[0] + q[1].R * a->ii[1]);
    e[E_E_damping] += h * (q[0].D * a->oo[0] + q[1].D * a->oo[1]);
    e[E_E_shaft] += h * a->shaft, e[E_E_wedge] += h * a->wedge, e[E_W_heart] += h * a->heart;
    e[E_W_caliper] += h * (k->tan * a->caliper + a->runout), e[E_W_stop] += h * a->stop;
    e[E_t_stuck] += h * a->stuck;
}

static void simulate(const double *p, double h, int64_t frames, int64_t steps, const double *u,
                     double *state, int64_t width, const int32_t *selected, double *rec)
{
    const Scheme s = prepare(p, h);
    const int64_t slow = llround(p[P_control_T_slow] / p[P_control_T_fast]);
    Saved z = start_of(state);
    Sim sim = {.b = z.b, .solver = {.key = -1}, .side = {1.0, 1.0}};
    double all[O_COUNT] = {0};
    for (int64_t n = 0; n <= frames; n++) {
        if (n % slow == 0)
            moment_tick(&s.k, &z, u + n * U_COUNT);
        position_tick(&s.k, &z, u + n * U_COUNT);
        if (n % slow == 0) {
            record(&s.k, &z, all);
            for (int64_t j = 0; j < width; j++)
                *rec++ = all[selected ? selected[j] : j];
        }
        if (n < frames)
            frame(&s, &sim, &z, steps);
    }
    state[X_COUNT + M_COUNT] = sim.unsettled, state[X_COUNT + M_COUNT + 1] = sim.passes;
}

/* One run: frames ticks of the position control of steps substeps each, and a row of all outputs
 * per tick of the moment control and at the end.
 * u: frames + 1 rows of stimulus; state: the model's State and Memory at the start, then room for
 * the numbers of substeps that did not settle and of passes. */
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
    const int64_t slow = llround(p[P_control_T_slow] / p[P_control_T_fast]);
    const int64_t length = X_COUNT + M_COUNT + 2, block = (frames / slow + 1) * width;
    for (int64_t c = 0; c < cases; c++)
        simulate(p + c * P_COUNT, h, frames, steps, u, state + c * length, width, selected,
                 rec + c * block);
}
