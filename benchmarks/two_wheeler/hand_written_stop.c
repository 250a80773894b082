/* The two-wheeler and its ECU, written by hand for this one vehicle, its default choices
 * (hand_stop.py lists them) and one time-stepping scheme: the yardstick for bywire's kernels.
 *
 * Implicit midpoint with the midpoint predicted from the last increment; what is nonlinear gets one
 * Newton step there. Brake and rolling resistance are one dry friction on each wheel, which holds
 * what rests and opposes what turns; substeps are cut where a wheel passes zero. The pressures
 * follow from their demands alone, the pitch from all else; speed and load are eliminated on paper,
 * see struct Rows, and two wheels are left.
 *
 * Written for one road at a time: adhesion is worked out anew only where surfaces change. A tyre
 * below its peak asks for no sliding curve, and a rolling one for no damping of standstill.
 *
 * The lines below are replaced by enums P_, X_, M_, U_, E_ and O_ of parameters, state, memory,
 * stimulus, integrals and outputs, generated from the model, and by the parts that stand apart. */
#include "hand_written_stop_indices.h"
#include "hand_written_stop_plant.h"
#include "hand_written_stop_ecu.h"

#define CAP 8        /* passes after which a substep whose contact changes is let go */
#define CUTS 6       /* of a substep, after which it is let go */
#define TRIES 12     /* lengths tried to find where a speed passes zero */
#define CLOSE 1e-12  /* share of a speed's change that counts as zero there */
#define EDGE 1e-9    /* least share of a part that is cut off or left */
#define STILL 1e-9   /* share of its speed below which the other wheel stops at the same instant */
#define PASSES 9     /* signs that two frictions can have */

/* What a pass gives: the state at the end, half its increment, rates of the integrals. */
typedef struct { State x, d; double rate[E_COUNT]; bool doubt; } Pass;

/* Forces of a wheel in terms of half increments: F = A + B d_v + C d_om + FN d_N, and what is left
 * for its deflection: d_u = iu (ru + b d_v - r d_om). */
typedef struct { double A, B, C, FN, F_y, iu, ru, b; } Rows;

/* Linearize a tyre at the predicted midpoint y, whose half increment is d. */
INLINE Rows rows_of(const Plant *k, const State *y, const State *d, int j,
                    const Limits *q, double N, double dN)
{
    const double r = k->r[j], u = y->u[j], v = y->v, v_w = r * y->om[j];
    const Tyre *t = k->tyre + j;
    const Slope f = force_slope(t, u, v, v_w, q);
    const bool beyond = fabs(u) > q->u;
    const double back = beyond ? (u - copysign(q->u, u)) / t->tau_slide : 0.0;
    const double speed = fabs(v), per_s = t->per_sigma;
    const double a = speed * per_s + (beyond ? 1.0 / t->tau_slide : 0.0);
    Rows w = {.FN = dN * f.mu, .F_y = N * f.mu, .b = 1.0 - (v < 0.0 ? -u : v > 0.0 ? u : 0.0) * per_s};
    w.iu = 1.0 / (k->two_h + a);
    w.ru = v - v_w - speed * u * per_s - back + a * d->u[j] - w.b * d->v + r * d->om[j];
    const double Fu = N * f.by_u, Fv = N * f.by_v, Fw = r * N * f.by_w;
    const double F = w.F_y - Fu * d->u[j] - Fv * d->v - Fw * d->om[j] - w.FN * d->N;
    w.A = F + Fu * w.iu * w.ru, w.B = Fv + Fu * w.iu * w.b, w.C = Fw - Fu * w.iu * r;
    return w;
}

/* Half increments of both wheels for the forces that do not depend on them c, the matrix S, and the
 * limits of their frictions; false where what rests must not rest. */
INLINE bool held(const double *S, const double *c, const double *most, const double *om, double *d)
{
    const bool still_f = om[0] == 0.0, still_r = om[1] == 0.0;
    const double b_f = c[0] - copysign(most[0], om[0]), b_r = c[1] - copysign(most[1], om[1]);
    if (!still_f && !still_r) {
        const double per = 1.0 / (S[0] * S[3] - S[1] * S[2]);
        d[0] = (b_f * S[3] - b_r * S[1]) * per, d[1] = (b_r * S[0] - b_f * S[2]) * per;
        return true;
    }
    d[0] = still_f ? 0.0 : b_f / S[0];
    d[1] = still_r ? 0.0 : b_r / S[3];
    const double on_f = S[1] * d[1] - c[0], on_r = S[2] * d[0] - c[1];
    return (!still_f || fabs(on_f) <= most[0]) && (!still_r || fabs(on_r) <= most[1]);
}

/* The same where a resting wheel may break away: the signs that fit. */
static void freed(const double *S, const double *c, const double *most, const double *om, double *d)
{
    for (int n = 0; n < PASSES; n++) {
        double try_om[2], way[2] = {n % 3 - 1.0, n / 3 - 1.0};
        bool fits = true;
        for (int j = 0; j < 2; j++) {
            fits &= om[j] == 0.0 || way[j] * om[j] > 0.0;
            try_om[j] = way[j];
        }
        if (!fits || !held(S, c, most, try_om, d))
            continue;
        for (int j = 0; j < 2; j++)
            fits &= om[j] != 0.0 || way[j] == 0.0 || way[j] * d[j] > 0.0;
        if (fits)
            return;
    }
}

/* Rates of the integrals at the midpoint z, with the limits of the tyres and the friction there. */
INLINE void rates(const Plant *k, const State *z, const Limits *q, Slopes road, double support,
                  const double *on, double *e)
{
    const double N_r = max2(z->N, 0.0), N[2] = {k->mg * road.cosine - N_r, N_r};
    double F = 0.0, rolling = 0.0;
    for (int j = 0; j < 2; j++) {
        const double v_w = k->r[j] * z->om[j], F_j = N[j] * force_slope(k->tyre + j, z->u[j], z->v, v_w, q + j).mu;
        const double most = k->C_rr[j] * N[j] * k->r[j];
        const double rolls = min2(most, fabs(on[j])) * fabs(z->om[j]);
        F += F_j, rolling += rolls;
        e[E_E_tyre_f + j] = F_j * (z->v - v_w);
        e[E_E_brake_f + j] = -on[j] * z->om[j] - rolls;
        e[E_t_locked_f + j] = z->om[j] == 0.0;
    }
    const double drag = k->drag * z->v * fabs(z->v);
    const Center at = center(k, z->phi);
    e[E_E_roll] = rolling, e[E_E_drag] = drag * z->v, e[E_E_air] = 0.0;
    e[E_W_ground] = -support * k->L * z->phi_rate;
    e[E_W_slope] = -k->mg * road.sine * z->v;
    e[E_W_pitch] = (F * at.h + drag * k->h_d + k->mg * (1.0 - road.cosine) * at.l) * z->phi_rate;
}

/* One pass from s with the predicted half increment d. Careful: resting wheels may break away. */
INLINE Pass pass(const Plant *k, const State *s, const State *d, const double *p_ref, bool careful)
{
    const State y = midpoint(s, d);
    const Slopes road = slopes_at(k, y.x);
    const double N_r = max2(y.N, 0.0), N[2] = {k->mg * road.cosine - N_r, N_r};
    const double lag = y.N > 0.0 ? 1.0 : 0.0;
    Limits q[2];
    Rows w[2];
    double most[2];
    Pass o;
    for (int j = 0; j < 2; j++) {
        q[j] = limits_of(k, j, ground_at(k, y.x - j * k->L), y.v, k->r[j] * y.om[j]);
        w[j] = rows_of(k, &y, d, j, q + j, N[j], j ? lag : -lag);
        most[j] = k->per_p[j] * max2(y.p[j], 0.0) + k->C_rr[j] * N[j] * k->r[j];
    }
    /* Speed and load in terms of the wheels, q = C_f d_f + C_r d_r. */
    const double A = w[0].A + w[1].A, B = w[0].B + w[1].B, FN = w[0].FN + w[1].FN;
    const double Fd_v = 2.0 * k->drag * fabs(y.v), Fd = k->drag * y.v * fabs(y.v) - Fd_v * d->v;
    const double F_y = w[0].F_y + w[1].F_y;
    const double rest = k->mg * road.cosine * k->l_f / k->L;
    const double carried = F_y * k->h + (Fd + Fd_v * d->v) * k->h_d;
    const bool on = rest - carried / k->L > 0.0;
    const double by_F = on ? k->h / k->L : 0.0, by_d = on ? k->h_d / k->L : 0.0;
    const double a11 = k->two_h * k->m + B + Fd_v, a12 = FN;
    const double a21 = by_F * B + by_d * Fd_v, a22 = k->two_h * k->tau_N + 1.0 + by_F * FN;
    const double b1 = -A - Fd - k->mg * road.sine;
    const double b2 = (on ? rest : 0.0) - s->N - by_F * A - by_d * Fd;
    const double per = 1.0 / (a11 * a22 - a12 * a21);
    const double v_0 = (b1 * a22 - b2 * a12) * per, N_0 = (b2 * a11 - b1 * a21) * per;
    const double v_1 = (by_F * a12 - a22) * per, N_1 = (a21 - by_F * a11) * per;
    double S[4], c[2], turn[2];
    for (int j = 0; j < 2; j++) {
        const double r = k->r[j], by_q = r * (w[j].B * v_1 + w[j].FN * N_1);
        c[j] = r * (w[j].A + w[j].B * v_0 + w[j].FN * N_0);
        S[2 * j] = -by_q * w[0].C, S[2 * j + 1] = -by_q * w[1].C;
        S[3 * j] += k->two_h * k->J[j] - r * w[j].C;
    }
    o.doubt = !held(S, c, most, s->om, turn);
    if (careful && o.doubt)
        freed(S, c, most, s->om, turn), o.doubt = false;
    const double both = w[0].C * turn[0] + w[1].C * turn[1];
    o.d.v = v_0 + v_1 * both, o.d.N = N_0 + N_1 * both;
    double F = A + B * o.d.v + FN * o.d.N + both, on_wheel[2];
    for (int j = 0; j < 2; j++) {
        o.d.om[j] = turn[j];
        o.d.u[j] = w[j].iu * (w[j].ru + w[j].b * o.d.v - k->r[j] * turn[j]);
        const double force = S[2 * j] * turn[0] + S[2 * j + 1] * turn[1] - c[j];
        on_wheel[j] = s->om[j] != 0.0 ? -copysign(most[j], s->om[j]) : clip(force, -most[j], most[j]);
        /* Pressures and angles: linear, and fed by nothing else. */
        const double seen = p_ref[j] - s->p[j], w2 = k->w_p[j] * k->w_p[j];
        const double damp = 2.0 * k->zeta[j] * k->w_p[j], fed = k->half * w2;
        o.d.p_rate[j] = (w2 * seen - (damp + fed) * s->p_rate[j])
                        / (k->two_h + damp + fed);
        o.d.p[j] = k->half * (s->p_rate[j] + o.d.p_rate[j]);
        o.d.th[j] = k->half * (s->om[j] + turn[j]);
    }
    o.d.x = k->half * (s->v + o.d.v);
    const bool closed = -k->L * (y.phi + k->tau_g * y.phi_rate) > 0.0;
    pitch(k, s, &y, d, road, F_y, F, Fd + Fd_v * o.d.v, closed, &o.d);
    const State z = midpoint(s, &o.d);
    o.x = midpoint(&z, &o.d);
    for (int j = 0; j < 2; j++)
        o.x.om[j] = s->om[j] + 2.0 * turn[j];
    const double depth = -k->L * (z.phi + k->tau_g * z.phi_rate);
    o.doubt |= closed ? depth < 0.0 : depth > 0.0;
    rates(k, &z, q, road, closed ? k->k_g * depth : 0.0, on_wheel, o.rate);
    return o;
}

static bool settle(const Plant *k, const State *s, State d, const double *p_ref, Pass *o)
{
    *o = pass(k, s, &d, p_ref, false);
    for (int n = 0; o->doubt && n < CAP; n++) {
        *o = pass(k, s, &d, p_ref, true);
        d = o->d;
    }
    return !o->doubt;
}

static bool part(const Plant *k, const State *s, const State *last, double t, const double *p_ref,
                 Pass *o)
{
    const Plant short_k = with_step(k, t);
    return settle(&short_k, s, scaled(last, t / k->h_s), p_ref, o);
}

/* The wheel that is the first to change its sign, -1 if none does, and at which share. */
static int first_turn(const State *s, const Pass *o, double *share)
{
    int first = -1;
    *share = 1.0;
    for (int j = 0; j < 2; j++) {
        const double a = s->om[j], b = o->x.om[j];
        if (a * b < 0.0 && a / (a - b) <= *share)
            *share = a / (a - b), first = j;
    }
    return first;
}

/* Shorten a part of length *t to where the first wheel stands: by the parabola through three
 * lengths, within what is known to lie before and behind. */
static int shorten(const Plant *k, const State *s, const State *last, double *t,
                   const double *p_ref, Pass *o, bool *settled)
{
    const double first = EDGE * *t, final = (1.0 - EDGE) * *t;
    double share, low = 0.0, high = *t, P = 0.0, Q = *t;
    int j = first_turn(s, o, &share);
    double at_P = s->om[j], at_Q = o->x.om[j], close = CLOSE * fabs(at_P - at_Q), N = share * *t;
    for (int n = 0; n < TRIES; n++) {
        N = clip(N, first, final);
        *settled = part(k, s, last, N, p_ref, o);
        const int other = first_turn(s, o, &share);
        if (other >= 0 && other != j) {
            j = other, low = 0.0, high = N, P = 0.0, at_P = s->om[j], Q = N, at_Q = o->x.om[j];
            close = CLOSE * fabs(at_P - at_Q), N *= share;
            continue;
        }
        const double at_N = o->x.om[j];
        if (fabs(at_N) <= close || N <= first || N >= final || N == P || N == Q)
            break;
        if (at_N * s->om[j] > 0.0)
            low = N;
        else
            high = N;
        const double slope = (at_N - at_P) / (N - P) + (at_N - at_Q) / (N - Q)
                             - (at_Q - at_P) / (Q - P), next = N - at_N / slope;
        if (fabs(P - next) > fabs(Q - next))
            P = N, at_P = at_N;
        else
            Q = N, at_Q = at_N;
        N = next > low && next < high ? next : 0.5 * (low + high);
    }
    *t = N;
    return j;
}

/* A substep in which the ground opens or closes, a wheel breaks away, or one passes zero. */
static void careful_step(const Plant *k, Sim *z)
{
    State s = z->x, last = z->d;
    double left = k->h_s, share, sum[E_COUNT] = {0};
    bool settled = true;
    Pass o;
    for (int cuts = 0;; cuts++) {
        bool well = part(k, &s, &last, left, z->p_ref, &o);
        if (cuts) {
            const Plant rest_k = with_step(k, left);
            well = settle(&rest_k, &s, o.d, z->p_ref, &o);
        }
        double t = left;
        int j = first_turn(&s, &o, &share);
        if (j >= 0 && cuts < CUTS)
            j = shorten(k, &s, &last, &t, z->p_ref, &o, &well);
        settled &= well && !(j >= 0 && cuts == CUTS);
        for (int n = 0; n < E_COUNT; n++)
            sum[n] += t * o.rate[n];
        last = scaled(&o.d, k->h_s / t);
        if (j >= 0)
            o.x.om[j] = last.om[j] = 0.0;
        for (int n = 0; j >= 0 && n < 2; n++)
            if (fabs(o.x.om[n]) < STILL * fabs(s.om[n]))
                o.x.om[n] = last.om[n] = 0.0;
        s = o.x;
        if (j < 0 || cuts == CUTS)
            break;
        left -= t;
    }
    z->x = s, z->d = last;
    for (int n = 0; n < E_COUNT; n++)
        z->e[n] += sum[n];
    z->careful += 1.0, z->unsettled += !settled;
}

/* The substeps of one tick. */
static void frame(const Plant *k, Sim *z, int64_t steps)
{
    double sum[E_COUNT] = {0};
    State s = z->x, d = z->d;
    for (int64_t n = 0; n < steps; n++) {
        const Pass o = pass(k, &s, &d, z->p_ref, false);
        if (o.doubt || o.x.om[0] * s.om[0] < 0.0 || o.x.om[1] * s.om[1] < 0.0) {
            z->x = s, z->d = d;
            careful_step(k, z);
            s = z->x, d = z->d;
            continue;
        }
        s = o.x, d = o.d;
        for (int j = 0; j < E_COUNT; j++)
            sum[j] += o.rate[j];
    }
    z->x = s, z->d = d;
    for (int j = 0; j < E_COUNT; j++)
        z->e[j] += k->h_s * sum[j];
}

static void simulate(const double *p, double h, int64_t frames, int64_t steps, const double *u,
                     double *state, int64_t width, const int32_t *selected, double *rec)
{
    const Plant k = prepare(p, h);
    Sim z = {.x = state_of(state)};
    memcpy(z.m, state + X_COUNT, sizeof z.m);
    double all[O_COUNT];
    for (int64_t n = 0; n <= frames; n++) {
        tick(&k, &z, u + n * U_COUNT);
        record(&k, &z, state, all);
        for (int64_t j = 0; j < width; j++)
            *rec++ = all[selected ? selected[j] : j];
        if (n < frames)
            frame(&k, &z, steps);
    }
    state[X_COUNT + M_COUNT] = z.unsettled, state[X_COUNT + M_COUNT + 1] = z.careful;
}

/* One run: frames ticks of steps substeps each, and a row of all outputs per tick and at the end.
 * u: frames + 1 rows of stimulus; state: the model's State and Memory at the start, then room for
 * the numbers of substeps that did not settle and that took more than one pass. */
void hand_run(const double *p, double h, int64_t frames, int64_t steps, const double *u,
              double *state, double *rec)
{
    simulate(p, h, frames, steps, u, state, O_COUNT, NULL, rec);
}

/* The same for many cases; see the motorcycle brake's. */
void hand_ensemble(int64_t cases, const double *p, double h, int64_t frames, int64_t steps,
                   const double *u, double *state, int64_t width, const int32_t *selected,
                   double *rec)
{
    const int64_t length = X_COUNT + M_COUNT + 2, block = (frames + 1) * width;
    for (int64_t c = 0; c < cases; c++)
        simulate(p + c * P_COUNT, h, frames, steps, u, state + c * length, width, selected,
                 rec + c * block);
}
