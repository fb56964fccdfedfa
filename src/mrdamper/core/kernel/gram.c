/* Gram sums of many candidates on many runs: what a least-squares fit asks for at every step. */

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
            gram(rows, n, columns, from[k], out + (j * runs + k) * rows * rows);
        }
    }
    free(columns);
    workspace_close(workspace);
    return status;
}
