/* Rows and their barrier state: a.x + level = s - w with s, w >= 0, and `cost` times s; hard rows have no s. */
#include <math.h>
#include <stdlib.h>
#include "problem.h"

int rows_allocate(Rows *r, int32_t rows, int32_t entries, int32_t slots) {
    r->count = r->entries = 0;
    r->capacity = rows;
    r->entry_capacity = entries;
    r->slots = slots;
    r->iteration = 0;
    r->begin = malloc(sizeof(int32_t) * (rows + 1));
    r->slot = malloc(sizeof(int32_t) * (rows + 1));
    r->plus = malloc(sizeof(int32_t) * (rows + 1));
    r->minus = malloc(sizeof(int32_t) * (rows + 1));
    r->column = malloc(sizeof(int32_t) * (entries + 1));
    r->value = malloc(sizeof(double) * (entries + 1));
    double **by_row[] = {&r->level, &r->cost, &r->bound, &r->D, &r->residual, &r->c1, &r->c2, &r->dz};
    double **by_slot[] = {&r->s, &r->w, &r->z, &r->y};
    int good = r->begin && r->slot && r->plus && r->minus && r->column && r->value;
    for (int k = 0; k < 8; k++) good &= (*by_row[k] = malloc(sizeof(double) * (rows + 1))) != NULL;
    for (int k = 0; k < 4; k++) good &= (*by_slot[k] = malloc(sizeof(double) * (slots + 1))) != NULL;
    r->seen = calloc(slots + 1, sizeof(int32_t));
    return good && r->seen;
}

void rows_free(Rows *r) {
    void *all[] = {r->begin, r->slot, r->plus, r->minus, r->bound, r->column, r->value, r->level, r->cost, r->D, r->residual,
                   r->c1,    r->c2,   r->dz,     r->s,     r->w,     r->z,    r->y, r->seen};
    for (unsigned k = 0; k < sizeof(all) / sizeof(*all); k++) free(all[k]);
}

void rows_begin(Rows *r) {
    r->count = r->entries = 0;
    r->iteration++;
    r->begin[0] = 0;
}

/* Add a row whose entries follow; 0 where there is no room for it. A slot that is new starts on the central path. */
int rows_add(Rows *r, int32_t slot, double level, double cost) {
    if (r->count >= r->capacity || r->entries + 64 > r->entry_capacity) return 0;
    const int k = r->count++;
    r->begin[k] = r->begin[k + 1] = r->entries;
    r->slot[k] = slot;
    r->level[k] = level;
    r->cost[k] = cost;
    r->plus[k] = r->minus[k] = NONE;
    const int new = r->seen[slot] != r->iteration - 1 || r->iteration == 1;
    if (cost == HARD) {
        if (new) {
            r->w[slot] = MAX(-level, r->least_room); /* a disc that is left begins with some */
            r->z[slot] = r->mu / r->w[slot];
        } else r->w[slot] = MAX(r->w[slot], -level);
        r->s[slot] = r->y[slot] = 0.0;
    } else if (new) {
        const double mu = r->mu, b = 2.0 * mu + cost * level;
        const double s = (b + sqrt(b * b - 4.0 * cost * mu * level)) / (2.0 * cost);
        r->s[slot] = s;
        r->w[slot] = MAX(s - level, 1e-12);
        r->z[slot] = mu / r->w[slot];
        if (r->z[slot] > cost) r->z[slot] = 0.999999 * cost;
        r->y[slot] = cost - r->z[slot];
    }
    r->seen[slot] = r->iteration;
    return 1;
}

/* Add a row that is but a quadratic term; 0 where there is no room for it. */
int rows_curve(Rows *r, double weight) {
    if (r->count >= r->capacity || r->entries + 64 > r->entry_capacity) return 0;
    const int k = r->count++;
    r->begin[k] = r->begin[k + 1] = r->entries;
    r->slot[k] = NONE;
    r->cost[k] = CURVE;
    r->D[k] = weight;
    r->plus[k] = r->minus[k] = NONE;
    return 1;
}

void rows_entry(Rows *r, int32_t column, double value) {
    r->column[r->entries] = column;
    r->value[r->entries++] = value;
    r->begin[r->count] = r->entries;
}

/* The last row is that of a disc or ball around velocities, or differences of two. */
void rows_disc(Rows *r, int32_t plus, int32_t minus, double bound) {
    r->plus[r->count - 1] = plus;
    r->minus[r->count - 1] = minus;
    r->bound[r->count - 1] = bound;
}

double row_multiplier(const Rows *r, int32_t row) { return r->z[r->slot[row]]; }
