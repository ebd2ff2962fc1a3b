/* Passive safety: an agent that stops without warning is not hit though the others react late, and stops in the box.
 *
 * The stopper brakes straight at its input limit from an instant within an interval; a follower stays on the plan until
 * `lag` samples after the interval's first, and brakes then. Distances are taken four times a step.
 */
#include <math.h>
#include <stddef.h>
#include "problem.h"

#define PER_STEP 4
#define AT_REST 1e-9
#define BOX_MARGIN 0.01 /* of stopping points in the box: that of separation at samples */

typedef struct {
    double distance, required, later, offset[MAX_DIMENSION];
    double speed[MAX_DIMENSION]; /* of the stopper when it begins to brake */
} Encounter;

/* Position at a time after braking begins. */
static void braking(int d, const double *q, const double *v, double later, double u, double *out) {
    const double speed = norm(d, v), time = MIN(later, speed / u);
    const double effective = time - 0.5 * time * time * u / MAX(speed, AT_REST);
    for (int a = 0; a < d; a++) out[a] = q[a] + effective * v[a];
}

/* Gradient by the velocity of the distance braked along `normal` within a time. */
static void braking_gradient(int d, const double *normal, const double *v, double time, double u, double *out) {
    const double speed = MAX(norm(d, v), AT_REST), stops_in = speed / u;
    double along = 0.0;
    for (int a = 0; a < d; a++) along += normal[a] * v[a] / speed;
    for (int a = 0; a < d; a++) {
        const double part = along * v[a] / speed, braked = MIN(time, stops_in);
        out[a] = time < stops_in ? braked * normal[a] - braked * braked / (2.0 * stops_in) * (normal[a] - part)
                                 : 0.5 * stops_in * (normal[a] + part);
    }
}

/* Where a follower is `elapsed` steps after sample n. */
static void follow(const Problem *p, const Motion *o, int n, int i, double elapsed, int lag, double *out) {
    const int d = p->dimension, m = p->agents, N = p->steps;
    const int whole = (int)floor(elapsed + 1e-9);
    if (whole < lag) {
        const int own = MIN(n + whole, N), after = MIN(own + 1, N);
        const double past = elapsed - whole;
        const double *q = o->q + (own * m + i) * d, *v = o->v + (own * m + i) * d, *v1 = o->v + (after * m + i) * d;
        for (int a = 0; a < d; a++) out[a] = q[a] + past * v[a] + 0.5 * past * past * (v1[a] - v[a]);
        return;
    }
    const int end = MIN(n + lag, N);
    braking(d, o->q + (end * m + i) * d, o->v + (end * m + i) * d, elapsed - lag, p->braking_input[i], out);
}

/* A lower bound on the distance of closest approach. */
static double bound(const Problem *p, const Motion *o, int n, const double *place, double speed, int stopper, int i, int lag) {
    const int d = p->dimension, m = p->agents, N = p->steps;
    double nearest = INFINITY, fastest = 0.0, last = 0.0;
    for (int k = 0; k <= lag; k++) {
        const int at = (MIN(n + k, N) * m + i) * d;
        double e[MAX_DIMENSION];
        for (int a = 0; a < d; a++) e[a] = place[a] - o->q[at + a];
        nearest = MIN(nearest, norm(d, e));
        last = norm(d, o->v + at);
        fastest = MAX(fastest, last);
    }
    const double follower = MAX(0.5 * fastest, last * last / (2.0 * p->braking_input[i]));
    return nearest - follower - speed * speed / (2.0 * p->braking_input[stopper]);
}

static int samples_that_stop(const Problem *p, const Motion *o, int lag) {
    const int st = p->agents * p->dimension;
    int moving = 0;
    for (int k = 0; k < st; k++) moving |= o->v[p->steps * st + k] != 0.0;
    return p->steps + 1 - (moving ? lag + 1 : 1);
}

/* The closest approach of one case; 0 if it is certainly farther than `reach` from a violation. */
static int encounter(const Problem *p, const Motion *o, int which, int n, int stopper, int follower, int pair, double reach, double longest, Encounter *e) {
    const int d = p->dimension, m = p->agents, lag = p->lag[which], at = (n * m + stopper) * d, st = m * d;
    const double part = p->lag_part[which], required = p->braking_separation[pair];
    double place[MAX_DIMENSION];
    if (!(required > 0.0) || !p->active[stopper] || !p->active[follower]) return 0;
    for (int a = 0; a < d; a++) {
        const double gain = part * (o->v[at + st + a] - o->v[at + a]);
        place[a] = o->q[at + a] + part * (o->v[at + a] + 0.5 * gain);
        e->speed[a] = o->v[at + a] + gain;
    }
    if (bound(p, o, n, place, norm(d, e->speed), stopper, follower, lag) >= required + reach) return 0;
    const int count = (int)ceil((lag + longest) * PER_STEP) + 1;
    e->distance = INFINITY;
    e->required = required;
    for (int g = 0; g < count; g++) {
        const double later = (double)g / PER_STEP;
        double stopped[MAX_DIMENSION], moved[MAX_DIMENSION], offset[MAX_DIMENSION];
        braking(d, place, e->speed, later, p->braking_input[stopper], stopped);
        follow(p, o, n, follower, later + part, lag, moved);
        for (int a = 0; a < d; a++) offset[a] = moved[a] - stopped[a];
        const double far = norm(d, offset);
        if (g == 0) e->required = MIN(required, far); /* else separation is violated, not passive safety */
        if (far < e->distance) {
            e->distance = far;
            e->later = later;
            for (int a = 0; a < d; a++) e->offset[a] = offset[a];
        }
    }
    return e->distance < e->required + reach;
}

static double longest_braking(const Problem *p, const Motion *o) {
    double longest = 0.0;
    for (int k = 0; k < (p->steps + 1) * p->agents; k++)
        longest = MAX(longest, norm(p->dimension, o->v + k * p->dimension) / p->braking_input[k % p->agents]);
    return longest;
}

typedef void (*encounter_use)(const Problem *, Workspace *, const Options *, Motion *, int, int, int, int, int, const Encounter *);

static void each_encounter(const Problem *p, Workspace *w, const Options *t, Motion *o, double reach, encounter_use use) {
    const int m = p->agents;
    const double longest = longest_braking(p, o);
    for (int which = 0; which < p->instants; which++) {
        const int last = samples_that_stop(p, o, p->lag[which]);
        for (int n = 0; n < last; n++)
            for (int i = 0, pair = 0; i < m; i++)
                for (int j = i + 1; j < m; j++, pair++)
                    for (int swap = 0; swap < 2; swap++) {
                        Encounter e;
                        const int stopper = swap ? j : i, follower = swap ? i : j;
                        if (encounter(p, o, which, n, stopper, follower, pair, reach, longest, &e))
                            use(p, w, t, o, which, n, stopper, follower, 2 * pair + swap, &e);
                    }
    }
}

static void count_violation(const Problem *p, Workspace *w, const Options *t, Motion *o, int which, int n, int stopper, int follower, int which_pair, const Encounter *e) {
    const double excess = e->required - e->distance;
    (void)p, (void)w, (void)t, (void)which, (void)n, (void)stopper, (void)follower, (void)which_pair;
    if (excess > 0.0) o->braking = MAX(o->braking, excess), o->braking_sum += excess;
}

/* How far the stopping point of agent i at sample n lies beyond a side of the box. */
static double beyond(const Problem *p, const Motion *o, int n, int i, int a, int side) {
    const int d = p->dimension, at = (n * p->agents + i) * d;
    const double end = o->q[at + a] + norm(d, o->v + at) / (2.0 * p->braking_input[i]) * o->v[at + a];
    const double low = MIN(p->box_low[i * d + a] + BOX_MARGIN, o->q[at + a]);
    const double high = MAX(p->box_high[i * d + a] - BOX_MARGIN, o->q[at + a]);
    return side ? end - high : low - end;
}

void measure_stopping(const Problem *p, Motion *o) {
    o->braking = o->braking_sum = 0.0;
    if (p->instants == 0) return;
    each_encounter(p, NULL, NULL, o, 0.0, count_violation);
    for (int n = 0; n <= p->steps; n++)
        for (int i = 0; i < p->agents; i++)
            for (int k = 0; p->active[i] && k < 2 * p->dimension; k++) {
                const double excess = beyond(p, o, n, i, k / 2, k % 2);
                if (excess > 0.0) o->braking = MAX(o->braking, excess), o->braking_sum += excess;
            }
}

static void add(Workspace *w, int d, int at, double factor, const double *normal) {
    for (int a = 0; a < d; a++) rows_entry(&w->rows, at + a, factor * normal[a]);
}

/* nbar.(follower - stopper) >= required at the closest approach; braking distances are linearised. */
static void encounter_row(const Problem *p, Workspace *w, const Options *t, Motion *o, int which, int n, int stopper, int follower, int which_pair, const Encounter *e) {
    const int d = p->dimension, m = p->agents, N = p->steps, lag = p->lag[which], half = w->half;
    const int slot = w->terms + 5 * (N + 1) * p->pairs + (2 + 4 * MAX_DIMENSION) * (N + 1) * m + 2 * MAX_DIMENSION * (N + 1) * m +
                     (which * (N + 1) + n) * 2 * p->pairs + which_pair;
    const double part = p->lag_part[which], elapsed = e->later + part, gain = 0.5 * part * part;
    const int whole = MIN((int)floor(elapsed + 1e-9), lag), own = MIN(n + whole, N), after = MIN(own + 1, N);
    const double past = elapsed - whole, square = 0.5 * past * past;
    double normal[MAX_DIMENSION] = {0}, brakes[MAX_DIMENSION], stopped[MAX_DIMENSION];
    if (!rows_add(&w->rows, slot, e->required - e->distance, t->penalty)) return;
    for (int a = 0; a < d; a++) normal[a] = e->distance > 1e-9 ? e->offset[a] / e->distance : (a == 0);
    const int f = (own * m + follower) * d, next = (after * m + follower) * d, s = (n * m + stopper) * d;
    add(w, d, f, -1.0, normal);
    if (whole < lag) {
        add(w, d, half + f, -(past - square), normal);
        add(w, d, half + next, -square, normal);
    } else {
        braking_gradient(d, normal, o->v + f, past, p->braking_input[follower], brakes);
        add(w, d, half + f, -1.0, brakes);
    }
    braking_gradient(d, normal, e->speed, e->later, p->braking_input[stopper], stopped);
    add(w, d, s, 1.0, normal);
    add(w, d, half + s, part - gain, normal);
    add(w, d, half + s, 1.0 - part, stopped);
    if (part > 0.0) {
        add(w, d, half + s + m * d, gain, normal);
        add(w, d, half + s + m * d, part, stopped);
    }
}

void stopping_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o) {
    const int d = p->dimension, m = p->agents, N = p->steps;
    const int begin = w->terms + 5 * (N + 1) * p->pairs + (2 + 4 * MAX_DIMENSION) * (N + 1) * m;
    if (p->instants == 0) return;
    each_encounter(p, w, t, (Motion *)o, 0.5 * t->step_max, encounter_row);
    for (int n = p->first; n <= N; n++)
        for (int i = 0; i < m; i++)
            for (int k = 0; p->active[i] && k < 2 * d; k++) {
                const int at = (n * m + i) * d, a = k / 2, side = k % 2;
                const double level = beyond(p, o, n, i, a, side);
                double normal[MAX_DIMENSION] = {0}, slope[MAX_DIMENSION];
                if (level < -t->step_max || !rows_add(&w->rows, begin + 2 * MAX_DIMENSION * (n * m + i) + k, level, t->penalty)) continue;
                normal[a] = side ? 1.0 : -1.0;
                braking_gradient(d, normal, o->v + at, INFINITY, p->braking_input[i], slope);
                rows_entry(&w->rows, at + a, normal[a]);
                add(w, d, w->half + at, 1.0, slope);
            }
}
