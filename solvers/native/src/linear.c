/* The Newton system: blocks by dense Cholesky, what couples them by conjugate gradients preconditioned by the blocks.
 *
 * With one block for the fleet that is a direct solve, the fastest for few variables. With a block for each agent the time
 * grows linearly with the agents: cells and pairs couple agents but weakly. Ends that are given are equalities of single
 * agents, which each block's solve satisfies, and with it all iterates (Gould, Hribar and Nocedal, SIAM J. Sci. Comput.
 * 23, 2001).
 */
#include <math.h>
#include <string.h>
#include "problem.h"

#define REGULARISATION 1e-8
#define CG_ITERATIONS 30   /* plain choice: inexact steps cost further steps, but no feasibility */
#define CG_TOLERANCE 1e-2  /* of the preconditioned residual's norm; plain choice */

/* The number in x of a block's component j of section s: positions at sample 0, then velocities of samples. */
static int global(const Workspace *w, const Block *b, int s, int j) { return s * w->stage + b->first + j; }

/* The condensed Hessian of a block's reduced variables: in the upper triangle of R and the diagonal, its factor below. */
static int factorise_block(Workspace *w, const Options *t, const Block *b) {
    const int nx = b->variables, nf = b->free, N = b->half / b->stage;
    const double *M = w->M + b->condensed;
    double *R = w->R + b->factor;
    int n = nf, info = 0;
    char upper = 'U'; /* row-major lower is column-major upper */
    double shift = REGULARISATION;
    if (nf == 0) return 1;
    for (int attempt = 0; attempt < 6; attempt++, shift *= 100.0) {
        memset(R, 0, sizeof(double) * (long)nf * nf);
        for (int s = 0, i = 0; s <= N; s++)
            for (int a = 0; a < b->stage; a++, i++) {
                const int fi = w->free_of[global(w, b, s, a)] - b->free_first;
                const double *row = M + (long)i * nx;
                if (fi < 0) continue;
                for (int z = 0, j = 0; z <= N; z++)
                    for (int c = 0; c < b->stage; c++, j++) {
                        const int fj = w->free_of[global(w, b, z, c)] - b->free_first;
                        if (fj >= 0 && fj <= fi) R[(long)fi * nf + fj] += row[j];
                    }
            }
        for (int i = 0; i < nf; i++) {
            R[(long)i * nf + i] += shift;
            w->diagonal[b->free_first + i] = R[(long)i * nf + i];
            for (int j = 0; j < i; j++) R[(long)j * nf + i] = R[(long)i * nf + j];
        }
        t->potrf(&upper, &n, R, &n, &info);
        if (info == 0) return 1;
    }
    return 0;
}

/* Rows E of the displacement of sample N (less that of sample 0, if closed), R^-1 E', and the factor of E R^-1 E'. */
static int factorise_ends(const Problem *p, Workspace *w, const Options *t, const Block *b) {
    const int nf = b->free, ne = b->equalities;
    int n = nf, columns = ne, info = 0, row = 0;
    char upper = 'U';
    double *E = w->E + 2L * b->equality_first * w->free, *solved = E + (long)ne * nf, *S = w->S + (long)b->equality_first * w->equalities;
    memset(E, 0, sizeof(double) * (long)ne * nf);
    for (int j = 0; j < b->stage; j++) {
        if (!p->active[(b->first + j) / p->dimension]) continue;
        double *e = E + (long)row++ * nf;
        const int start = w->free_of[global(w, b, 0, j)];
        if (!p->closed && start >= 0) e[start - b->free_first] += 1.0;
        for (int k = 0; k <= p->steps; k++) {
            const int f = w->free_of[global(w, b, k + 1, j)];
            if (f >= 0) e[f - b->free_first] += k == 0 || k == p->steps ? 0.5 : 1.0;
        }
    }
    memcpy(solved, E, sizeof(double) * (long)ne * nf);
    t->potrs(&upper, &n, &columns, w->R + b->factor, &n, solved, &n, &info);
    for (int a = 0; a < ne; a++)
        for (int c = 0; c <= a; c++) {
            double s = a == c ? 1e-12 : 0.0;
            for (int k = 0; k < nf; k++) s += E[(long)a * nf + k] * solved[(long)c * nf + k];
            S[a * ne + c] = s;
        }
    t->potrf(&upper, &columns, S, &columns, &info);
    return info == 0;
}

int factorise(const Problem *p, Workspace *w, const Options *t) {
    for (int k = 0; k < w->blocks; k++) {
        const Block *b = w->block + k;
        condense(p, w, b);
        if (!factorise_block(w, t, b)) return 0;
        if (b->equalities > 0 && b->free > 0 && !factorise_ends(p, w, t, b)) return 0;
    }
    return 1;
}

/* Solve with the blocks alone, in place; the ends stay where they are. */
static void solve_blocks(Workspace *w, const Options *t, double *v) {
    int one = 1, info = 0;
    char upper = 'U';
    for (int k = 0; k < w->blocks; k++) {
        const Block *b = w->block + k;
        int n = b->free, size = b->equalities;
        double *x = v + b->free_first;
        if (n == 0) continue;
        t->potrs(&upper, &n, &one, w->R + b->factor, &n, x, &n, &info);
        if (size == 0) continue;
        const double *E = w->E + 2L * b->equality_first * w->free, *solved = E + (long)size * n;
        double *multiplier = w->scratch;
        for (int a = 0; a < size; a++) {
            multiplier[a] = 0.0;
            for (int i = 0; i < n; i++) multiplier[a] += E[(long)a * n + i] * x[i];
        }
        t->potrs(&upper, &size, &one, w->S + (long)b->equality_first * w->equalities, &size, multiplier, &size, &info);
        for (int a = 0; a < size; a++)
            for (int i = 0; i < n; i++) x[i] -= solved[(long)a * n + i] * multiplier[a];
    }
}

/* What rows that belong to several blocks add to a product beyond the blocks. */
static void add_coupling(const Problem *p, Workspace *w, const double *x, double *y) {
    const Rows *r = &w->rows;
    const int half = w->half, st = w->stage;
    double *gq = w->tmp, *gv = w->dv;
    for (int i = 0; i < w->variables; i++) w->dx[i] = w->free_of[i] >= 0 ? x[w->free_of[i]] : 0.0;
    roll_out(p, w->dx, w->dq);
    memset(gq, 0, sizeof(double) * half);
    memset(gv, 0, sizeof(double) * half);
    for (int k = 0; k < r->count; k++) {
        int several = 0;
        const int begin = r->begin[k], end = r->begin[k + 1];
        double all = 0.0;
        for (int a = begin; a < end; a++) {
            const int i = r->column[a], block = w->block_of[i < half ? i : i - half];
            several |= block != w->block_of[r->column[begin] < half ? r->column[begin] : r->column[begin] - half];
            w->part[block] = 0.0;
        }
        if (!several) continue;
        for (int a = begin; a < end; a++) {
            const int i = r->column[a];
            const double here = r->value[a] * (i < half ? w->dq[i] : w->dx[st + i - half]);
            w->part[w->block_of[i < half ? i : i - half]] += here;
            all += here;
        }
        for (int a = begin; a < end; a++) {
            const int i = r->column[a], c = i < half ? i : i - half;
            (i < half ? gq : gv)[c] += r->D[k] * r->value[a] * (all - w->part[w->block_of[c]]);
        }
    }
    roll_back(p, gq, w->g);
    for (int i = 0; i < half; i++) w->g[st + i] += gv[i];
    for (int i = 0; i < w->variables; i++)
        if (w->free_of[i] >= 0) y[w->free_of[i]] += w->g[i];
}

static void multiply(const Problem *p, Workspace *w, const double *x, double *y) {
    for (int k = 0; k < w->blocks; k++) {
        const Block *b = w->block + k;
        const double *R = w->R + b->factor, *v = x + b->free_first;
        double *u = y + b->free_first;
        for (int i = 0; i < b->free; i++) u[i] = w->diagonal[b->free_first + i] * v[i];
        for (int i = 0; i < b->free; i++) {
            const double *row = R + (long)i * b->free;
            double sum = 0.0;
            for (int j = i + 1; j < b->free; j++) {
                sum += row[j] * v[j];
                u[j] += row[j] * v[i];
            }
            u[i] += sum;
        }
    }
    add_coupling(p, w, x, y);
}

static double dot(int n, const double *a, const double *b) {
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* Solve for rhs, in place. */
void solve_reduced(const Problem *p, Workspace *w, const Options *t) {
    const int n = w->free;
    if (w->blocks == 1) {
        solve_blocks(w, t, w->rhs);
        return;
    }
    double *x = w->solution, *r = w->residual, *d = w->direction, *z = w->product;
    memcpy(r, w->rhs, sizeof(double) * n);
    memcpy(z, r, sizeof(double) * n);
    memset(x, 0, sizeof(double) * n);
    solve_blocks(w, t, z);
    memcpy(d, z, sizeof(double) * n);
    double now = dot(n, r, z);
    const double enough = CG_TOLERANCE * CG_TOLERANCE * now;
    for (int k = 0; k < CG_ITERATIONS && now > enough && now > 0.0; k++) {
        multiply(p, w, d, z);
        const double curvature = dot(n, d, z);
        if (!(curvature > 0.0)) break;
        const double step = now / curvature;
        for (int i = 0; i < n; i++) {
            x[i] += step * d[i];
            r[i] -= step * z[i];
        }
        memcpy(z, r, sizeof(double) * n);
        solve_blocks(w, t, z);
        const double next = dot(n, r, z);
        for (int i = 0; i < n; i++) d[i] = z[i] + next / now * d[i];
        now = next;
    }
    memcpy(w->rhs, x, sizeof(double) * n);
}
