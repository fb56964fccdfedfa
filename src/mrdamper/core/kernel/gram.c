/* Compute the Gram matrices of many candidates on many runs. A least-squares fit needs them in each step. */

/* Products are summed in eight lanes, sample i in lane i % 8. The sums are therefore bitwise equal for every width
 * of a pack. The sums of a tile (rows times rows) stay in registers, and a block of samples stays in the
 * first-level cache. */
#define TILE_I (PACK == 8 ? 4 : 2)
#define TILE_J 4

/* Add the products of n samples (a multiple of 8) to the lanes of a tile. */
static void gram_tile(size_t n, const double *const *a, const double *const *b, double *const lanes[TILE_I][TILE_J])
{
    for (size_t part = 0; part < 8; part += PACK) {
        pack sum[TILE_I][TILE_J];
        for (size_t i = 0; i < TILE_I; i++)
            for (size_t j = 0; j < TILE_J; j++) sum[i][j] = *(const loose_pack *)(lanes[i][j] + part);
        for (size_t k = part; k < n; k += 8) {
            pack x[TILE_I];
            for (size_t i = 0; i < TILE_I; i++) x[i] = *(const loose_pack *)(a[i] + k);
            for (size_t j = 0; j < TILE_J; j++) {
                const pack y = *(const loose_pack *)(b[j] + k);
                for (size_t i = 0; i < TILE_I; i++) sum[i][j] += x[i] * y;
            }
        }
        for (size_t i = 0; i < TILE_I; i++)
            for (size_t j = 0; j < TILE_J; j++) *(loose_pack *)(lanes[i][j] + part) = sum[i][j];
    }
}

/* Add the products of the samples from `from` to `to` - 1, one by one. */
static void gram_few(size_t rows, const double *const *row, size_t from, size_t to, double *lanes)
{
    for (size_t i = 0; i < rows; i++)
        for (size_t j = 0; j <= i; j++)
            for (size_t k = from; k < to; k++) lanes[8 * (i * rows + j) + (k & 7)] += row[i][k] * row[j][k];
}

/* Add the products of samples [from, to) of all pairs of rows to lanes [row][row][8]. Only the lower triangle is
 * used. A tile that extends beyond the last row computes the last row twice. */
static void gram_add(size_t rows, const double *const *row, size_t from, size_t to, double *lanes)
{
    const size_t begin = (from + 7) / 8 * 8 < to ? (from + 7) / 8 * 8 : to, end = begin + (to - begin) / 8 * 8;
    gram_few(rows, row, from, begin, lanes);
    for (size_t at = begin; at < end; at += BLOCK) {
        const size_t n = end - at < BLOCK ? end - at : BLOCK;
        for (size_t i = 0; i < rows; i += TILE_I) {
            for (size_t j = 0; j < i + TILE_I && j < rows; j += TILE_J) {
                const double *a[TILE_I], *b[TILE_J];
                double *sums[TILE_I][TILE_J];
                for (size_t p = 0; p < TILE_I; p++) {
                    const size_t one = i + p < rows ? i + p : rows - 1;
                    a[p] = row[one] + at;
                    for (size_t q = 0; q < TILE_J; q++) {
                        const size_t other = j + q < rows ? j + q : rows - 1;
                        b[q] = row[other] + at;
                        sums[p][q] = lanes + 8 * (one * rows + other);
                    }
                }
                gram_tile(n, a, b, (double *const(*)[TILE_J])sums);
            }
        }
    }
    gram_few(rows, row, end, to, lanes);
}

/* Compute the Gram matrix: add up the eight lanes of each element. */
static void gram_close(size_t rows, const double *lanes, double *out)
{
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double *l = lanes + 8 * (i * rows + j);
            out[i * rows + j] = ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]));
            out[j * rows + i] = out[i * rows + j];
        }
    }
}

static mrd_status gram(size_t rows, size_t n, const double *columns, size_t from, double *out)
{
    double *lanes = calloc(8 * rows * rows, sizeof *lanes);
    const double **row = calloc(rows + 1, sizeof *row);
    if (lanes && row) {
        for (size_t i = 0; i < rows; i++) row[i] = columns + i * n;
        gram_add(rows, row, from, n, lanes);
        gram_close(rows, lanes, out);
    }
    const mrd_status status = lanes && row ? MRD_OK : MRD_NO_MEMORY;
    free(lanes);
    free(row);
    return status;
}

/* Memory and indices for all candidates and runs. The rows of a Gram matrix are the tangents, then the residual. */
typedef struct {
    size_t places, rows;
    const int *by;
    double *columns, *one; /* [rows][longest run], [longest run] */
    double *lanes;         /* [rows][rows][8] */
} gram_room;

/* Return the channel of the run that equals the tangent of a coefficient, or NULL if there is no such channel. */
static const double *channel_of(const mrd_model *m, const mrd_record *r, int coefficient, const double *one)
{
    if (coefficient == C_MASS) return r->a;
    if (coefficient == C_VISCOSITY && m->coefficient[C_VISCOUS_EXPONENT] == 1.0) return r->v;
    if (coefficient == C_STIFFNESS && !has_own_spring(m->law)) return r->x;
    return coefficient == C_OFFSET && !has_own_spring(m->law) ? one : NULL;
}

/* Collect the directions whose tangents must be computed, and return their number. row[i] is set to the location of
 * tangent i. */
static size_t directions_of(const gram_room *g, const mrd_model *m, const mrd_record *r, mrd_direction *direction,
                            const double **row)
{
    size_t count = 0;
    for (size_t i = 0; i < g->places; i++) {
        row[i] = channel_of(m, r, g->by[i], g->one);
        if (row[i]) continue;
        row[i] = g->columns + count * r->n;
        direction[count++] = (mrd_direction){g->by[i], NULL, 0};
    }
    return count;
}

/* Compute the Gram matrix of one candidate on one run. */
static mrd_status gram_of_one(const gram_room *g, const mrd_model *m, const mrd_record *r, const double *measured,
                              size_t from, mrd_workspace *workspace, double *out)
{
    mrd_direction direction[MRD_DIRECTIONS];
    const double *row[MRD_DIRECTIONS + 1];
    const size_t directions = directions_of(g, m, r, direction, row);
    double *residual = g->columns + (g->rows - 1) * r->n;
    row[g->rows - 1] = residual;
    const mrd_status status = run(m, r, directions, direction, residual, g->columns, workspace);
    if (status != MRD_OK) return status;
    for (size_t i = 0; i < r->n; i++) residual[i] = measured[i] - residual[i];
    memset(g->lanes, 0, 8 * g->rows * g->rows * sizeof *g->lanes);
    gram_add(g->rows, row, from, r->n, g->lanes);
    gram_close(g->rows, g->lanes, out);
    return MRD_OK;
}

/* Arguments of gram_sums(). */
typedef struct {
    mrd_law law;
    size_t runs, candidates, count; /* count: coefficients of the law */
    const mrd_record *const *records;
    const double *const *measured;
    const size_t *from;
    const double *coefficients;
    size_t part, parts;
    double *out;
    double *residuals; /* [candidate][samples of all runs in turn], or NULL */
} gram_task;

static mrd_model model_of(const gram_task *t, size_t job)
{
    const mrd_model m = {t->law, t->coefficients + job * t->count, 0};
    return m;
}

/* Return the destination of the residuals of a job, or NULL if residuals are not needed. */
static double *residual_of(const gram_task *t, size_t job)
{
    size_t at = 0, all = 0;
    for (size_t k = 0; k < t->runs; k++) {
        at += k < job % t->runs ? t->records[k]->n : 0;
        all += t->records[k]->n;
    }
    return t->residuals ? t->residuals + job / t->runs * all + at : NULL;
}

#include "gram_lanes.c"

static mrd_status gram_one_by_one(const gram_room *g, const gram_task *t)
{
    mrd_workspace *workspace = workspace_open();
    mrd_status status = workspace ? MRD_OK : MRD_NO_MEMORY;
    for (size_t job = t->part; job < t->candidates * t->runs && status == MRD_OK; job += t->parts) {
        const size_t k = job % t->runs;
        const mrd_model m = model_of(t, job);
        status = gram_of_one(g, &m, t->records[k], t->measured[k], t->from[k], workspace, t->out + job * g->rows * g->rows);
        const size_t n = t->records[k]->n;
        double *residual = residual_of(t, job);
        if (residual && status == MRD_OK) memcpy(residual, g->columns + (g->rows - 1) * n, n * sizeof *residual);
    }
    workspace_close(workspace);
    return status;
}

/* Write the Gram matrices to out[candidate][run][row][row]. The rows are the tangents of the coefficients `by`, then
 * the residual (measured minus computed force). Samples before from[run] are ignored. The coefficients
 * [candidate][run][coefficient] are constant during each run. `residuals`, if not NULL, receives the residuals as
 * [candidate][samples of all runs in turn]. The work consists of `parts` parts, which can be computed in parallel. A call
 * computes one of them. */
static mrd_status gram_sums(mrd_law law, size_t runs, const mrd_record *const *records, const double *const *measured,
                            const size_t *from, size_t candidates, const double *coefficients, size_t places,
                            const int *by, size_t part, size_t parts, double *out, double *residuals)
{
    const size_t count = (size_t)coefficient_count((int)law), rows = places + 1;
    if (!count) return MRD_NOT_A_LAW;
    const gram_task task = {law, runs, candidates, count, records, measured, from, coefficients, part, parts, out, residuals};
    size_t longest = 1;
    for (size_t k = 0; k < runs; k++) longest = records[k]->n > longest ? records[k]->n : longest;
    double *store = malloc(((rows + 1) * longest + 8 * rows * rows) * sizeof *store);
    if (!store) return MRD_NO_MEMORY;
    const gram_room room = {places, rows, by, store, store + rows * longest, store + (rows + 1) * longest};
    for (size_t i = 0; i < longest; i++) room.one[i] = 1.0;
    const mrd_status status = has_own_spring(law) ? gram_in_lanes(&room, &task, longest) : gram_one_by_one(&room, &task);
    free(store);
    return status;
}
