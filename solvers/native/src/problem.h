/* The coverage problem and the state of its interior point, shared by all files of this folder.
 *
 * Units: lengths in a sensing radius, times in a step: velocities are lengths per step, inputs lengths per step squared,
 * and the dynamics (4.23) are q+ = q + (v + v+)/2. Variables x = (q_0, v_0, ..., v_N), agent by agent, axis by axis;
 * positions follow from them exactly. Memory belongs to a workspace that is allocated once per call.
 */
#ifndef PROBLEM_H
#define PROBLEM_H

#include <math.h>
#include <stdint.h>

#define MAX_DIMENSION 3
#define WITHIN 8        /* parts of an interval at which distances are sampled; the first is its first sample */
#define MOST_INSTANTS 2 /* worst instants of stopping (passive safety) */

typedef void (*potrf_t)(char *, int *, double *, int *, int *);
typedef void (*potrs_t)(char *, int *, int *, double *, int *, double *, int *, int *);

typedef struct {
    int32_t steps, agents, dimension, pairs; /* N, m, d, m (m-1)/2 */
    int32_t first;                           /* first sample that is not given: 1, or 0 for a free start */
    int32_t closed;                          /* whether the last state equals the first */
    int32_t end_fixed;                       /* whether positions at sample N are given (or those at 0, if closed) */
    int32_t long_steps;                      /* whether pairs and box are kept at control points instead of by margins */
    int32_t linked;                          /* whether a communication range is to be kept */
    int32_t instants;                        /* stops (passive safety) per step; 0 without passive safety */
    int32_t dense_max;                       /* variables up to which the fleet is one block */
    int32_t demands;                         /* pairs (magnitude, cell) that are owed */
    int32_t parts, continuous;               /* looks in each interval; whether its nearest point counts */
    double range;                            /* longest edge, margin included */
    const double *speed_max, *input_max;     /* (m,) that rows keep */
    const double *speed_limit, *input_limit; /* (m,) from which on a motion is infeasible */
    const double *braking_input;             /* (m,) of braking agents */
    const uint8_t *active;                   /* (m,) not lost */
    const double *box_low, *box_high;        /* (m, d), given samples included */
    const double *box_aside;                 /* (m,) by which a path may deviate from its chord */
    const double *separation;                /* (pairs,) margin included; 0 for none */
    const double *braking_separation;        /* (pairs,) in passive safety; 0 for none */
    const double *pair_aside;                /* (pairs,) by which a distance may deviate from its chord */
    const uint8_t *link;                     /* (pairs,) kept at all times */
    const double *cell;                      /* (K, d) */
    const double *radius;                    /* (J, m), -inf where an agent cannot measure */
    const int32_t *demand_cell, *demand_magnitude, *demand_looks; /* (demands,) */
    const double *demand_weight;                                  /* (demands,) mean 1 */
    const int32_t *lag;                                           /* (instants,) */
    const double *lag_part;                                       /* (instants,) */
    const uint8_t *fixed;                                         /* ((N+2) m d,) variables that are given */
} Problem;

typedef struct {
    int32_t stages, iterations, stage_iterations, samples; /* continuation; M samples of a soft minimum */
    const double *sharpness, *floor, *overshoot;                      /* (stages,) beta, least barrier parameter, and parts of
                                                              their radii by which steps may leave discs */
    double margin;                                         /* sensing margin times beta */
    double penalty;                                        /* per length of violated pair or box */
    double proximal, barrier, step_max, small_step;
    double least_room;                                     /* first slack of a disc that is left, as a part of its radius */
    double feasibility, limit_feasibility, input_feasibility, braking_tolerance, braking_cost;
    double tie;                                            /* excess up to which a cell is measured */
    double deadline_s;                                     /* on CLOCK_MONOTONIC; infinity for none */
    potrf_t potrf;
    potrs_t potrs;
} Options;

typedef struct {
    double cost, violation, braking; /* of the best motion: J, largest violation, and that of passive safety */
    int32_t iterations, stage, outcome;
} Result;

#define HARD (-1.0) /* cost of rows that have no slack */
#define CURVE (-2.0) /* cost of rows that are but a term D/2 (a.x)^2 */
#define NONE (-1)   /* no such column */

enum { COMPLETE = 0, CONVERGED = 1, MAX_ITERATIONS = 2, DEADLINE = 3, NUMERICAL = 4, OUT_OF_MEMORY = 5 };

/* A motion and all that judge and linearisation have in common, computed once per motion. */
typedef struct {
    double *x, *q, *v;                  /* variables, positions, velocities (N+1, m, d); v points into x */
    int32_t *near;                      /* (terms, M) samples n m + i of soft minima */
    double *near_distance, *near_part;  /* (terms, M) distances, and parts of the interval after the sample */
    double *near_excess;                /* (terms, M) distance - radius */
    double *share, *level;              /* (terms, M), (terms,) */
    double *least, *most, *sampled;     /* (N, pairs) within intervals, (N+1, pairs) at samples */
    uint8_t *tree;                      /* (N, pairs) */
    double hard, soft, violation, penalty, braking, braking_sum;
} Motion;

/* Rows a.(x_q, x_v) + level <= s, elastic at a cost, or hard (cost HARD, no s). Each has a slot that keeps its
 * barrier state between iterations. The quadratic part of a hard disc's row is |x_plus - x_minus|^2 / (2 bound). */
typedef struct {
    int32_t count, capacity, entries, entry_capacity;
    int32_t *begin, *slot, *plus, *minus, *column; /* columns: positions [0, half), velocities [half, 2 half) */
    double *value, *level, *cost, *bound;
    double *D, *residual, *c1, *c2, *dz;
    /* barrier state by slot */
    int32_t slots, iteration;
    int32_t *seen;
    double *s, *w, *z, *y;
    double mu, least_room, overshoot; /* barrier parameter; see Options */
} Rows;

/* Blocks are what is factorised together: the whole fleet, or each agent, whose coupling is left to conjugate gradients. */
typedef struct {
    int32_t first, stage, half, variables; /* first component of a sample, components, columns, variables */
    int32_t free_first, free;              /* its part of the reduced variables */
    long hessian, condensed, factor;       /* where its part of Hqq, Hqv and Hvv, of M, and of R begins */
    int32_t equality_first, equalities;
} Block;

typedef struct {
    int32_t stage, half, variables, terms, free, equalities, blocks;
    int32_t widest;                        /* samples that any demand ranks */
    int32_t *free_of, *term_first, *index; /* x -> reduced variable, -1 fixed; demand -> its first term; ranking */
    int32_t *block_of, *local;             /* column of a position or velocity -> block, and number within it */
    long *row_of;                          /* column -> where its row of Hqq, Hqv, Hvv begins */
    Block *block;
    int32_t has_velocity_columns;
    long hessian; /* entries of each of Hqq, Hqv, Hvv */
    double *Hqq, *Hqv, *Hvv, *B, *M, *R, *E, *S, *diagonal;
    double *gradient_q, *gradient_v, *g, *rhs, *dx, *dq, *dv, *tmp;
    double *residual, *direction, *product, *solution; /* of conjugate gradients */
    double region;                                     /* trust region: part of the largest step and overshoot */
    double *scratch, *part;
    Rows rows;
} Workspace;

static inline double norm(int d, const double *e) {
    double square = 0.0;
    for (int a = 0; a < d; a++) square += e[a] * e[a];
    return sqrt(square);
}

/* Add to an entry of a Hessian, or drop it where it couples blocks. */
static inline void add_entry(const Workspace *w, double *H, int i, int j, double h) {
    if (w->block_of[i] == w->block_of[j]) H[w->row_of[i] + w->local[j]] += h;
}

/* Vector instructions of the machine at hand, where the compiler can choose among them at run time. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define FOR_THIS_MACHINE __attribute__((target_clones("avx2", "default")))
#else
#define FOR_THIS_MACHINE
#endif

#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))

/* dynamics.c */
void roll_out(const Problem *p, const double *x, double *q);
void roll_back(const Problem *p, const double *gq, double *g);
void condense(const Problem *p, Workspace *w, const Block *b);

/* rows.c */
int rows_allocate(Rows *r, int32_t rows, int32_t entries, int32_t slots);
void rows_free(Rows *r);
void rows_begin(Rows *r);
int rows_add(Rows *r, int32_t slot, double level, double cost);
void rows_disc(Rows *r, int32_t plus, int32_t minus, double bound);
void rows_entry(Rows *r, int32_t column, double value);
int rows_curve(Rows *r, double weight);
double row_multiplier(const Rows *r, int32_t row);

/* coverage.c */
long nearest_doubles(const Problem *p, int widest);
void find_nearest(const Problem *p, const Workspace *w, int samples, Motion *o);
void coverage_levels(const Problem *p, const Workspace *w, const Options *t, double beta, Motion *o);
void coverage_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o);

/* pairs.c */
void measure_pairs(const Problem *p, Motion *o);
void pair_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o);

/* limits.c */
void measure_limits(const Problem *p, const Options *t, Motion *o);
void limit_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o);

/* stopping.c */
void measure_stopping(const Problem *p, Motion *o);
void stopping_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o);

/* linear.c */
int factorise(const Problem *p, Workspace *w, const Options *t);
void solve_reduced(const Problem *p, Workspace *w, const Options *t);

/* newton.c */
int newton_step(const Problem *p, Workspace *w, const Options *t, double mu_floor, double *largest, double *length);

#endif
