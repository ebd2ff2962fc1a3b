/* Positions from velocities, their adjoint, and the condensed Hessian: q_n = q_0 + sum of means of velocities (4.23). */
#include "problem.h"

void roll_out(const Problem *p, const double *x, double *q) {
    const int st = p->agents * p->dimension;
    const double *v = x + st;
    for (int j = 0; j < st; j++) q[j] = x[j];
    for (int k = 0; k < p->steps * st; k++) q[st + k] = q[k] + 0.5 * (v[k] + v[st + k]);
}

/* g = (dq/dx)' gq, over x = (q_0, v) */
void roll_back(const Problem *p, const double *gq, double *g) {
    const int st = p->agents * p->dimension, N = p->steps;
    for (int j = 0; j < st; j++) {
        double later = 0.0;
        for (int n = N; n > 0; n--) {
            const double here = gq[n * st + j];
            g[st + n * st + j] = later + 0.5 * here;
            later += here;
        }
        g[st + j] = 0.5 * later;
        g[j] = later + gq[j];
    }
}

/* M = L' Hqq L + L' Hqv + Hqv' L + Hvv, with q = L x; of one block. */
FOR_THIS_MACHINE
void condense(const Problem *p, Workspace *w, const Block *k) {
    const int st = k->stage, half = k->half, nx = k->variables, N = p->steps;
    const double *Hqq = w->Hqq + k->hessian, *Hqv = w->Hqv + k->hessian, *Hvv = w->Hvv + k->hessian;
    double *B = w->B, *M = w->M + k->condensed, *later = w->scratch;
    /* B (nx, half) = L' Hqq (+ L' Hqv in M's velocity columns below) */
    for (int j = 0; j < st; j++) {
        for (int c = 0; c < half; c++) later[c] = 0.0;
        for (int n = N; n > 0; n--) {
            const double *h = Hqq + (long)(n * st + j) * half;
            double *b = B + (long)(st + n * st + j) * half;
            for (int c = 0; c < half; c++) {
                b[c] = later[c] + 0.5 * h[c];
                later[c] += h[c];
            }
        }
        const double *h = Hqq + (long)j * half;
        double *b = B + (long)(st + j) * half, *a = B + (long)j * half;
        for (int c = 0; c < half; c++) {
            b[c] = 0.5 * later[c];
            a[c] = later[c] + h[c];
        }
    }
    /* M = B L */
    for (int r = 0; r < nx; r++) {
        const double *b = B + (long)r * half;
        double *m = M + (long)r * nx, *sum = w->scratch;
        for (int j = 0; j < st; j++) sum[j] = 0.0;
        for (int n = N; n > 0; n--)
            for (int j = 0; j < st; j++) {
                const double here = b[n * st + j];
                m[st + n * st + j] = sum[j] + 0.5 * here;
                sum[j] += here;
            }
        for (int j = 0; j < st; j++) {
            m[st + j] = 0.5 * sum[j];
            m[j] = sum[j] + b[j];
        }
    }
    for (int r = 0; r < half; r++)
        for (int c = 0; c < half; c++) M[(long)(st + r) * nx + st + c] += Hvv[(long)r * half + c];
    if (!w->has_velocity_columns) return;
    /* += L' Hqv and its transpose */
    for (int j = 0; j < st; j++) {
        for (int c = 0; c < half; c++) later[c] = 0.0;
        for (int n = N; n >= 0; n--) {
            const double *h = Hqv + (long)(n * st + j) * half;
            double *own = M + (long)(st + n * st + j) * nx, *start = M + (long)j * nx;
            const double part = n > 0 ? 0.5 : 0.0;
            for (int c = 0; c < half; c++) {
                const double add = (n > 0 ? later[c] : 0.5 * later[c]) + part * h[c];
                own[st + c] += add;
                M[(long)(st + c) * nx + st + n * st + j] += add;
                later[c] += n > 0 ? h[c] : 0.0;
                if (n == 0) {
                    const double all = later[c] + h[c];
                    start[st + c] += all;
                    M[(long)(st + c) * nx + j] += all;
                }
            }
        }
    }
}
