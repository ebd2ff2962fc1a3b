/* One step of the interior point on the linearised problem; centring by prediction (Mehrotra, SIAM J. Optim. 2, 1992).
 *
 * Slacks and multipliers of elastic rows are eliminated exactly: with 0 < z < cost, a row adds D a a' to the Hessian of
 * positions and velocities, D = 1 / (s/y + w/z). Dynamics are eliminated by `condense`; a dense Cholesky does the rest.
 */
#include <math.h>
#include <string.h>
#include "problem.h"

#define LEAST_CENTRING 0.0025 /* least factor of the barrier parameter in a step */
#define TO_BOUNDARY 0.95 /* part of the way to its bound by which a slack or multiplier may move */

FOR_THIS_MACHINE
static void add_row(Workspace *w, int k) {
    const Rows *r = &w->rows;
    const int half = w->half;
    const double D = r->D[k];
    for (int a = r->begin[k]; a < r->begin[k + 1]; a++) {
        const int velocity = r->column[a] >= half, i = r->column[a] - (velocity ? half : 0);
        const int block = w->block_of[i];
        const double f = D * r->value[a];
        double *qq = w->Hqq + w->row_of[i], *qv = w->Hqv + w->row_of[i], *vv = w->Hvv + w->row_of[i];
        for (int b = r->begin[k]; b < r->begin[k + 1]; b++) {
            const int moving = r->column[b] >= half, j = r->column[b] - (moving ? half : 0);
            if (w->block_of[j] != block) continue;
            if (velocity && moving) vv[w->local[j]] += f * r->value[b];
            else if (!velocity) (moving ? qv : qq)[w->local[j]] += f * r->value[b];
        }
    }
}

/* Residuals, weights D, gradient and Hessian; the barrier parameter is that of the present iterate. */
static void assemble(Workspace *w, const Options *t) {
    Rows *r = &w->rows;
    const int half = w->half;
    double sum = 0.0;
    int products = 0;
    for (int k = 0; k < r->count; k++) {
        if (r->cost[k] == CURVE) {
            add_row(w, k);
            continue;
        }
        const int slot = r->slot[k];
        const double s = r->s[slot], v = r->w[slot], z = r->z[slot], y = r->y[slot];
        const int hard = r->cost[k] == HARD;
        r->residual[k] = r->level[k] - s + v;
        sum += v * z + (hard ? 0.0 : s * y);
        products += hard ? 1 : 2;
        r->D[k] = hard ? z / v : 1.0 / (s / y + v / z);
        for (int a = r->begin[k]; a < r->begin[k + 1]; a++) {
            const int i = r->column[a];
            *(i < half ? w->gradient_q + i : w->gradient_v + i - half) += z * r->value[a];
        }
        add_row(w, k);
    }
    for (int i = 0; i < half; i++) add_entry(w, w->Hqq, i, i, t->proximal);
    r->mu = products ? sum / products : 0.0;
}

/* Directions dx, dq, dv for the complementarity targets c1, c2; dz of each row. */
static void solve(const Problem *p, Workspace *w, const Options *t) {
    Rows *r = &w->rows;
    const int half = w->half, nx = w->variables, nf = w->free, st = w->stage;
    double *gq = w->tmp, *gv = w->dv;
    memcpy(gq, w->gradient_q, sizeof(double) * half);
    memcpy(gv, w->gradient_v, sizeof(double) * half);
    for (int k = 0; k < r->count; k++) {
        if (r->cost[k] == CURVE) continue;
        const int slot = r->slot[k];
        const double e = r->cost[k] == HARD ? (r->c1[k] + r->z[slot] * r->residual[k]) / r->w[slot]
                                            : r->D[k] * (r->residual[k] + r->c1[k] / r->z[slot] - r->c2[k] / r->y[slot]);
        r->dz[k] = e;
        for (int a = r->begin[k]; a < r->begin[k + 1]; a++) {
            const int i = r->column[a];
            *(i < half ? gq + i : gv + i - half) += e * r->value[a];
        }
    }
    roll_back(p, gq, w->g);
    for (int i = 0; i < half; i++) w->g[st + i] += gv[i];
    memset(w->rhs, 0, sizeof(double) * nf);
    for (int i = 0; i < nx; i++)
        if (w->free_of[i] >= 0) w->rhs[w->free_of[i]] -= w->g[i];
    solve_reduced(p, w, t);
    for (int i = 0; i < nx; i++) w->dx[i] = w->free_of[i] >= 0 ? w->rhs[w->free_of[i]] : 0.0;
    roll_out(p, w->dx, w->dq);
    for (int k = 0; k < r->count; k++) {
        if (r->cost[k] == CURVE) continue;
        double along = 0.0;
        for (int a = r->begin[k]; a < r->begin[k + 1]; a++) {
            const int i = r->column[a];
            along += r->value[a] * (i < half ? w->dq[i] : w->dx[st + i - half]);
        }
        r->dz[k] += r->D[k] * along;
    }
}

/* Changes of slack, multiplier and elastic slack of row k in the direction that was solved for. */
static void row_change(const Rows *r, int k, double *dw, double *dz, double *ds) {
    const int slot = r->slot[k];
    *dz = r->dz[k];
    *dw = (r->c1[k] - r->w[slot] * *dz) / r->z[slot];
    *ds = r->cost[k] == HARD ? 0.0 : (r->c2[k] + r->s[slot] * *dz) / r->y[slot];
}

/* The rate at which a disc's level changes along the direction, and its quadratic part. */
static double level_rate(const Workspace *w, int k, double *bend) {
    const Rows *r = &w->rows;
    const double *dv = w->dx + w->stage;
    double rate = 0.0;
    *bend = 0.0;
    for (int a = r->begin[k]; a < r->begin[k + 1]; a++) {
        const int i = r->column[a];
        rate += r->value[a] * (i < w->half ? w->dq[i] : dv[i - w->half]);
    }
    const int d = (r->begin[k + 1] - r->begin[k]) / (r->minus[k] == NONE ? 1 : 2);
    for (int a = 0; a < d; a++) {
        const double e = dv[r->plus[k] + a] - (r->minus[k] == NONE ? 0.0 : dv[r->minus[k] + a]);
        *bend += e * e / (2.0 * r->bound[k]);
    }
    return rate;
}

/* The longest step up to 1 by which no disc is left by more than the overshoot; one that is already may be left farther. */
static double longest_step(const Workspace *w) {
    const Rows *r = &w->rows;
    double step = 1.0;
    for (int k = 0; k < r->count; k++) {
        if (r->cost[k] != HARD) continue;
        double bend;
        const double rate = level_rate(w, k, &bend), level = r->level[k] - r->overshoot * r->bound[k];
        if (level >= 0.0) continue;
        const double longest = bend > 1e-14 ? (-rate + sqrt(rate * rate - 4.0 * bend * level)) / (2.0 * bend)
                               : rate > 0.0 ? -level / rate : INFINITY;
        step = MIN(step, TO_BOUNDARY * longest);
    }
    return step;
}

/* The barrier parameter to aim at after a step without centring. Second-order terms as in Mehrotra's corrector slowed
 * descents down here, as the problem is linearised anew after each step. */
static double predicted_barrier(const Rows *r, double mu_floor) {
    double primal = 1.0, dual = 1.0, now = 0.0, then = 0.0, dw, dz, ds;
    for (int k = 0; k < r->count; k++) {
        const int slot = r->slot[k];
        if (r->cost[k] == CURVE) continue;
        row_change(r, k, &dw, &dz, &ds);
        if (dz < 0.0) dual = MIN(dual, -r->z[slot] / dz);
        if (r->cost[k] == HARD) continue;
        if (dw < 0.0) primal = MIN(primal, -r->w[slot] / dw);
        if (ds < 0.0) primal = MIN(primal, -r->s[slot] / ds);
        if (dz > 0.0) dual = MIN(dual, r->y[slot] / dz);
    }
    for (int k = 0; k < r->count; k++) {
        const int slot = r->slot[k];
        if (r->cost[k] == HARD || r->cost[k] == CURVE) continue;
        row_change(r, k, &dw, &dz, &ds);
        then += (r->w[slot] + primal * dw) * (r->z[slot] + dual * dz) + (r->s[slot] + primal * ds) * (r->y[slot] - dual * dz);
        now += r->w[slot] * r->z[slot] + r->s[slot] * r->y[slot];
    }
    const double ratio = now > 0.0 ? MIN(MAX(then / now, 0.0), 1.0) : 0.0;
    return MAX(MAX(ratio * ratio, LEAST_CENTRING) * r->mu, mu_floor);
}

/* Predict without centring, then aim at the barrier parameter that the prediction justifies, but at least `mu_floor`.
 * The step is left in dx; `largest` is its largest displacement, `length` its
 * part of a whole step. Slacks and multipliers move, each as far as it may. */
int newton_step(const Problem *p, Workspace *w, const Options *t, double mu_floor, double *largest, double *length) {
    Rows *r = &w->rows;
    assemble(w, t);
    if (!factorise(p, w, t)) return 0;
    for (int k = 0; k < r->count; k++) {
        if (r->cost[k] == CURVE) continue;
        const int slot = r->slot[k];
        r->c1[k] = -r->w[slot] * r->z[slot];
        r->c2[k] = r->cost[k] == HARD ? 0.0 : -r->s[slot] * r->y[slot];
    }
    solve(p, w, t);
    const double target = predicted_barrier(r, mu_floor);
    for (int k = 0; k < r->count; k++) r->c1[k] += target, r->c2[k] += target;
    solve(p, w, t);
    double big = 0.0;
    for (int i = 0; i < w->half; i++) big = MAX(big, fabs(w->dq[i]));
    const double step = MIN(longest_step(w), big > 0.0 ? w->region * t->step_max / big : 1.0);
    for (int k = 0; k < r->count; k++) {
        const int slot = r->slot[k];
        if (r->cost[k] == CURVE) continue;
        const double keep = 1.0 - TO_BOUNDARY, z = r->z[slot], y = r->y[slot];
        double dw, dz, ds;
        row_change(r, k, &dw, &dz, &ds);
        r->z[slot] = MAX(z + dz, keep * z);
        r->w[slot] = MAX(r->w[slot] + step * dw, keep * r->w[slot]);
        if (r->cost[k] == HARD) continue;
        r->s[slot] = MAX(r->s[slot] + step * ds, keep * r->s[slot]);
        r->z[slot] = MIN(r->z[slot], z + TO_BOUNDARY * y);
        r->y[slot] = r->cost[k] - r->z[slot];
    }
    for (int i = 0; i < w->variables; i++) w->dx[i] *= step;
    *largest = step * big;
    *length = step;
    return isfinite(*largest);
}
