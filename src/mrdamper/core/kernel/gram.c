/* Gram sums of many candidates on many runs: what a least-squares fit asks for at every step. */

/* Products are summed in eight lanes, sample i in lane i % 8, whatever the width of a pack: the same bits at every one. A
 * tile of rows against rows stays in registers, over a block of samples that stays in the first-level cache. */
#define TILE_I (PACK == 8 ? 4 : 2)
#define TILE_J 4

/* Add the products of samples 8 k of n / 8 eights to the lanes of a tile. */
static void gram_tile(size_t n, const double *const *a, const double *const *b, double *const lanes[TILE_I][TILE_J])
{
    for (size_t part = 0; part < 8; part += PACK) {
        pack sum[TILE_I][TILE_J];
        for (size_t i = 0; i < TILE_I; i++)
            for (size_t j = 0; j < TILE_J; j++) sum[i][j] = *(const pack *)(lanes[i][j] + part);
        for (size_t k = part; k < n; k += 8) {
            pack x[TILE_I];
            for (size_t i = 0; i < TILE_I; i++) x[i] = *(const pack *)(a[i] + k);
            for (size_t j = 0; j < TILE_J; j++) {
                const pack y = *(const pack *)(b[j] + k);
                for (size_t i = 0; i < TILE_I; i++) sum[i][j] += x[i] * y;
            }
        }
        for (size_t i = 0; i < TILE_I; i++)
            for (size_t j = 0; j < TILE_J; j++) *(pack *)(lanes[i][j] + part) = sum[i][j];
    }
}

/* Add samples [from, to) of rows that lie `stride` apart to lanes [row][row][8]; of each pair the lower triangle counts.
 * A tile that reaches beyond the last row works that one out twice. */
static void gram_add(size_t rows, size_t stride, const double *columns, size_t from, size_t to, double *lanes)
{
    const size_t begin = (from + 7) / 8 * 8 < to ? (from + 7) / 8 * 8 : to, end = begin + (to - begin) / 8 * 8;
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double *x = columns + i * stride, *y = columns + j * stride;
            for (size_t k = from; k < begin; k++) lanes[8 * (i * rows + j) + (k & 7)] += x[k] * y[k];
        }
    }
    for (size_t at = begin; at < end; at += BLOCK) {
        const size_t n = end - at < BLOCK ? end - at : BLOCK;
        for (size_t i = 0; i < rows; i += TILE_I) {
            for (size_t j = 0; j < i + TILE_I && j < rows; j += TILE_J) {
                const double *a[TILE_I], *b[TILE_J];
                double *sums[TILE_I][TILE_J];
                for (size_t p = 0; p < TILE_I; p++) {
                    const size_t row = i + p < rows ? i + p : rows - 1;
                    a[p] = columns + row * stride + at;
                    for (size_t q = 0; q < TILE_J; q++) {
                        const size_t other = j + q < rows ? j + q : rows - 1;
                        b[q] = columns + other * stride + at;
                        sums[p][q] = lanes + 8 * (row * rows + other);
                    }
                }
                gram_tile(n, a, b, (double *const(*)[TILE_J])sums);
            }
        }
    }
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double *x = columns + i * stride, *y = columns + j * stride;
            for (size_t k = end; k < to; k++) lanes[8 * (i * rows + j) + (k & 7)] += x[k] * y[k];
        }
    }
}

/* The sums of the lanes. */
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
    if (!lanes) return MRD_NO_MEMORY;
    gram_add(rows, n, columns, from, n, lanes);
    gram_close(rows, lanes, out);
    free(lanes);
    return MRD_OK;
}

/* out[candidate][run][row][row]: sums of products, from sample from[run] on, of the tangents by the coefficients
 * `by`, of a one if `ones`, and of measured less computed force. Coefficients [candidate][run][coefficient] are
 * constant over each run. */
static mrd_status gram_sums(mrd_law law, size_t runs, const mrd_record *const *records, const double *const *measured,
                            const size_t *from, size_t candidates, const double *coefficients, size_t places,
                            const int *by, int ones, double *out)
{
    const size_t count = (size_t)coefficient_count((int)law), rows = places + (ones ? 2 : 1);
    if (!count) return MRD_NOT_A_LAW;
    size_t longest = 1;
    for (size_t k = 0; k < runs; k++) longest = records[k]->n > longest ? records[k]->n : longest;
    mrd_direction direction[MRD_DIRECTIONS];
    for (size_t d = 0; d < places; d++) direction[d] = (mrd_direction){by[d], NULL, 0};
    double *columns = malloc(rows * longest * sizeof *columns);
    mrd_workspace *workspace = workspace_open();
    mrd_status status = columns && workspace ? MRD_OK : MRD_NO_MEMORY;
    for (size_t j = 0; j < candidates && status == MRD_OK; j++) {
        for (size_t k = 0; k < runs && status == MRD_OK; k++) {
            const mrd_model m = {law, coefficients + (j * runs + k) * count, 0};
            const size_t n = records[k]->n;
            double *residual = columns + (rows - 1) * n;
            const double *y = measured[k];
            status = run(&m, records[k], places, direction, residual, columns, workspace);
            if (status != MRD_OK) break;
            for (size_t i = 0; i < n; i++) residual[i] = y[i] - residual[i];
            if (ones)
                for (size_t i = 0; i < n; i++) columns[places * n + i] = 1.0;
            status = gram(rows, n, columns, from[k], out + (j * runs + k) * rows * rows);
        }
    }
    free(columns);
    workspace_close(workspace);
    return status;
}
