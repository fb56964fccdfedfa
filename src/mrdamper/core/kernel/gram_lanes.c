/* Gram matrices of a stepped law, for LANES jobs at a time. A job is a candidate on a run, and a lane computes one job.
 * Rows are interleaved: sample i of lane k is at index LANES i + k. One pass over a block of samples therefore adds up
 * the products of every lane. The runs of a block may differ in length; missing samples of a lane are zero. */

#define STEPS (BLOCK / LANES) /* samples of a block */

/* Content of one lane: a candidate on a run. */
typedef struct {
    size_t job, run;
    mrd_model model;
    const mrd_record *record;
    const double *row[MRD_DIRECTIONS + 1]; /* tangents that do not require steps of the law; NULL for the others */
    double *left; /* measured force minus the force of the common terms */
    double *residual; /* destination of measured minus computed force, or NULL */
} lane_job;

/* Sort key of a job. Jobs with the same number of substeps are computed together, longest job first. */
typedef struct {
    size_t substeps, n, job;
} job_order;

static int compare_jobs(const void *one, const void *other)
{
    const job_order *a = one, *b = other;
    if (a->substeps != b->substeps) return a->substeps < b->substeps ? -1 : 1;
    if (a->n != b->n) return a->n > b->n ? -1 : 1;
    return a->job < b->job ? -1 : a->job > b->job;
}

/* Compute the tangents that do not require steps of the law, and the measured force minus the common terms. Write them
 * to store[rows + 1][longest]. */
static mrd_status lane_open(lane_job *lane, const gram_room *g, const gram_task *t, size_t job, size_t longest, double *store)
{
    lane->job = job;
    lane->run = job % t->runs;
    lane->model = model_of(t, job);
    lane->record = t->records[lane->run];
    lane->residual = residual_of(t, job);
    const mrd_record *r = lane->record;
    mrd_direction direction[MRD_DIRECTIONS] = {{0, NULL, 0}};
    size_t count = 0;
    for (size_t i = 0; i < g->places; i++) {
        lane->row[i] = channel_of(&lane->model, r, g->by[i], g->one);
        if (!lane->row[i] && !is_inside(t->law, g->by[i])) direction[count++] = (mrd_direction){g->by[i], NULL, 0};
    }
    common_rows common;
    const mrd_status opened = common_open(&lane->model, r, count, direction, &common);
    if (opened != MRD_OK) return opened;
    count = 0;
    for (size_t i = 0; i < g->places; i++) {
        if (lane->row[i] || is_inside(t->law, g->by[i])) continue;
        double *column = store + (1 + count) * longest;
        common_column(&lane->model, r, &common, direction + count++, column);
        lane->row[i] = column;
    }
    lane->left = store;
    memset(lane->left, 0, r->n * sizeof *lane->left);
    common_add(&lane->model, r, &common, lane->left);
    for (size_t i = 0; i < r->n; i++) lane->left[i] = t->measured[lane->run][i] - lane->left[i];
    common_close(&common);
    return MRD_OK;
}

/* Interleave samples [begin, end) of one array of every lane. A run that has ended repeats its last sample. */
static void gather(const double *const *source, const lane_job *lane, size_t begin, size_t end, double *restrict out)
{
    for (size_t k = 0; k < LANES; k++) {
        const size_t last = lane[k].record->n - 1;
        for (size_t i = begin; i < end; i++) out[LANES * (i - begin) + k] = source[k][i < last ? i : last];
    }
}

/* Step the law through a block of samples. Write the interleaved forces to `force` and the interleaved tangents to
 * column[d]. Packs without a job are skipped. */
static void step_block(mrd_law law, law_lanes *state, lane_samples *t, const lane_job *lane, size_t jobs, size_t begin,
                       size_t end, double *force, double *const *column)
{
    double x[LANES * (STEPS + 1)], v[LANES * (STEPS + 1)];
    const double *xs[LANES], *vs[LANES];
    for (size_t k = 0; k < LANES; k++) {
        xs[k] = lane[k].record->x;
        vs[k] = lane[k].record->v;
    }
    const size_t before = begin ? begin - 1 : 0;
    gather(xs, lane, before, end, x);
    gather(vs, lane, before, end, v);
    for (size_t part = 0; part < jobs; part += PACK) {
        double step[PACK];
        for (size_t k = 0; k < PACK; k++) step[k] = lane[part + k].record->step;
        memcpy(&t->step, step, sizeof step);
        for (size_t i = begin; i < end; i++) {
            const size_t to = LANES * (i - begin) + part, at = LANES * (i - before) + part;
            double *by[MRD_DIRECTIONS];
            pack xx[2], vv[2];
            for (size_t d = 0; d < t->ways; d++) by[d] = column[d] + to;
            for (size_t k = 0; k < 2; k++) {
                const size_t from = k || !i ? at : at - LANES;
                xx[k] = *(const loose_pack *)(x + from);
                vv[k] = *(const loose_pack *)(v + from);
            }
            t->x = xx;
            t->v = vv;
            lanes_step(law, state + part / PACK, !i, t, force + to, by);
        }
    }
}

/* Compute the Gram matrices of up to LANES jobs with the same number of substeps. Unused lanes repeat a job. Every
 * record has at least one sample. `block` is [rows][BLOCK]. */
static void gram_of_lanes(const gram_room *g, const gram_task *t, const lane_job *lane, size_t jobs, double *block)
{
    law_lanes state[LANES / PACK];
    const mrd_model *model[LANES];
    const mrd_record *record[LANES];
    const double *row[MRD_DIRECTIONS + 1], *source[LANES];
    double *column[MRD_DIRECTIONS];
    int way[MRD_DIRECTIONS];
    size_t longest = 0, ways = 0;
    for (size_t k = 0; k < LANES; k++) {
        model[k] = &lane[k].model;
        record[k] = lane[k].record;
        longest = record[k]->n > longest ? record[k]->n : longest;
    }
    for (size_t part = 0; part < LANES; part += PACK) lanes_begin(t->law, model + part, state + part / PACK);
    for (size_t i = 0; i < g->rows; i++) row[i] = block + i * BLOCK;
    for (size_t i = 0; i < g->places; i++) {
        if (lane[0].row[i]) continue;
        way[ways] = g->by[i];
        column[ways++] = block + i * BLOCK;
    }
    double *residual = block + (g->rows - 1) * BLOCK, force[BLOCK] = {0.0};
    lane_samples samples = {pack_of(0.0), substeps_of(t->law, record[0]), NULL, NULL, NULL, NULL, ways, way, NULL, NULL};
    memset(g->lanes, 0, 8 * g->rows * g->rows * sizeof *g->lanes);
    for (size_t begin = 0; begin < longest; begin += STEPS) {
        const size_t end = begin + STEPS < longest ? begin + STEPS : longest, n = LANES * (end - begin);
        step_block(t->law, state, &samples, lane, jobs, begin, end, force, column);
        for (size_t i = 0; i + 1 < g->rows; i++) {
            if (!lane[0].row[i]) continue;
            for (size_t k = 0; k < LANES; k++) source[k] = lane[k].row[i];
            gather(source, lane, begin, end, block + i * BLOCK);
        }
        for (size_t k = 0; k < LANES; k++) source[k] = lane[k].left;
        gather(source, lane, begin, end, residual);
        for (size_t i = 0; i < n; i++) residual[i] -= force[i];
        for (size_t k = 0; k < jobs; k++)
            for (size_t i = begin; lane[k].residual && i < end && i < record[k]->n; i++)
                lane[k].residual[i] = residual[LANES * (i - begin) + k];
        for (size_t k = 0; k < LANES; k++) {
            const size_t from = t->from[lane[k].run], to = record[k]->n;
            if (from <= begin && to >= end) continue;
            for (size_t i = begin; i < end; i++)
                for (size_t d = 0; d < g->rows && (i < from || i >= to); d++) block[d * BLOCK + LANES * (i - begin) + k] = 0.0;
        }
        gram_add(g->rows, row, 0, n, g->lanes);
    }
}

/* Return the part of the work to which a pack of jobs belongs. The packs are dealt to the parts forwards and backwards in
 * turn, because earlier packs are longer. */
static size_t part_of(size_t index, size_t parts)
{
    const size_t turn = index % (2 * parts);
    return turn < parts ? turn : 2 * parts - 1 - turn;
}

static mrd_status gram_in_lanes(const gram_room *g, const gram_task *t, size_t longest)
{
    const size_t all = t->candidates * t->runs, each = (g->rows + 1) * longest, square = g->rows * g->rows;
    size_t jobs = 0, packs = 0;
    job_order *order = malloc((all + 1) * sizeof *order);
    double *store = calloc(LANES * each + g->rows * BLOCK, sizeof *store);
    lane_job *lane = malloc(LANES * sizeof *lane);
    mrd_status status = order && store && lane ? MRD_OK : MRD_NO_MEMORY;
    for (size_t job = 0; job < all && status == MRD_OK; job++) {
        const mrd_record *r = t->records[job % t->runs];
        if (r->n) order[jobs++] = (job_order){substeps_of(t->law, r), r->n, job};
        else memset(t->out + job * square, 0, square * sizeof *t->out);
    }
    if (status == MRD_OK) qsort(order, jobs, sizeof *order, compare_jobs);
    for (size_t first = 0, next; first < jobs && status == MRD_OK; first = next) {
        for (next = first; next < jobs && next < first + LANES; next++)
            if (order[next].substeps != order[first].substeps) break;
        if (part_of(packs++, t->parts) != t->part) continue;
        for (size_t k = 0; first + k < next && status == MRD_OK; k++)
            status = lane_open(lane + k, g, t, order[first + k].job, longest, store + k * each);
        for (size_t k = next - first; k < LANES; k++) lane[k] = lane[0];
        if (status != MRD_OK) break;
        gram_of_lanes(g, t, lane, next - first, store + LANES * each);
        for (size_t k = 0; first + k < next; k++) {
            double *out = t->out + lane[k].job * square;
            for (size_t i = 0; i < g->rows; i++)
                for (size_t j = 0; j <= i; j++)
                    out[i * g->rows + j] = out[j * g->rows + i] = g->lanes[8 * (i * g->rows + j) + k];
        }
    }
    free(order);
    free(store);
    free(lane);
    return status;
}
