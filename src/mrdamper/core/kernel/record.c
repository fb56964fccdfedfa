/* Monotone pieces of a run between turning points. They are computed once, because all candidates use the same pieces.
 *
 * A reversal is a turning point if the displacement returns by more than the dead band. Its position inside the sample
 * interval is the extremum of the cubic Hermite interpolant of (x, v) at the two samples.
 *
 * A run may be divided into batches. The samples from the extreme sample on are settled only when the motion has passed
 * this extreme or has turned. A batch returns the forces of the settled samples. At rest, the number of unsettled
 * samples would grow. Therefore, after `patience` samples all of them are settled as if the motion continued, and a
 * later turn begins with the next sample.
 */
#include <stdlib.h>

/* Return the extremum of the Hermite cubic in one interval, or the extreme end if there is no extremum inside. */
static double hermite_extremum(double x0, double v0, double x1, double v1, double h, double side)
{
    const double c1 = v0 * h, c2 = 3.0 * (x1 - x0) - (2.0 * v0 + v1) * h, c3 = (v0 + v1) * h - 2.0 * (x1 - x0);
    double best = side * x0 > side * x1 ? x0 : x1;
    double root[2] = {-1.0, -1.0};
    const double qa = 3.0 * c3, qb = 2.0 * c2, disc = qb * qb - 4.0 * qa * c1;
    if (disc >= 0.0) {
        const double q = -0.5 * (qb + (qb >= 0.0 ? sqrt(disc) : -sqrt(disc)));
        if (q != 0.0) root[0] = c1 / q;
        if (qa != 0.0) root[1] = q / qa;
    }
    for (int i = 0; i < 2; i++) {
        if (root[i] > 0.0 && root[i] < 1.0) {
            const double l = root[i], x = x0 + l * (c1 + l * (c2 + l * c3));
            if (side * x > side * best) best = x;
        }
    }
    return best;
}

static double turning_point(const mrd_record *r, size_t k, double side)
{
    double best = r->x[k];
    if (k > 0) {
        const double x = hermite_extremum(r->x[k - 1], r->v[k - 1], r->x[k], r->v[k], r->step, side);
        if (side * x > side * best) best = x;
    }
    if (k + 1 < r->known) {
        const double x = hermite_extremum(r->x[k], r->v[k], r->x[k + 1], r->v[k + 1], r->step, side);
        if (side * x > side * best) best = x;
    }
    return best;
}

/* Motion between two samples: the cubic Hermite interpolant. */
typedef struct {
    double x, d, c2, c3, step;
} interval;

static inline interval interval_before(const mrd_record *r, size_t i)
{
    const double x0 = r->x[i - 1], x1 = r->x[i], d0 = r->v[i - 1] * r->step, d1 = r->v[i] * r->step;
    const interval out = {x0, d0, 3.0 * (x1 - x0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (x1 - x0), r->step};
    return out;
}

/* Compute displacement and velocity at a fraction of the interval. */
static inline void interval_at(const interval *b, double l, double *x, double *v)
{
    *x = b->x + l * (b->d + l * (b->c2 + l * b->c3));
    *v = (b->d + l * (2.0 * b->c2 + l * 3.0 * b->c3)) / b->step;
}

static void record_close(mrd_record *r)
{
    free(r->first);
    free(r->turn);
    free(r->side);
    free(r->path);
    r->first = NULL;
    r->turn = r->side = r->path = NULL;
}

/* Begin a piece of motion; `room` is the capacity of the lists. */
static int piece_begin(mrd_record *r, size_t *room, size_t first, double turn, double side)
{
    if (r->pieces + 1 >= *room) {
        const size_t more = *room ? 2 * *room : 64;
        size_t *firsts = realloc(r->first, more * sizeof *firsts);
        if (firsts) r->first = firsts;
        double *turns = realloc(r->turn, more * sizeof *turns);
        if (turns) r->turn = turns;
        double *sides = realloc(r->side, more * sizeof *sides);
        if (sides) r->side = sides;
        if (!firsts || !turns || !sides) return 0;
        *room = more;
    }
    r->first[r->pieces] = first;
    r->turn[r->pieces] = turn;
    r->side[r->pieces] = side;
    r->pieces++;
    return 1;
}

/* Return true if side * (x - turn) never decreases inside a piece and is never negative. A separate path is then not
 * needed. */
static int never_falls(const mrd_record *r)
{
    for (size_t p = 0; p < r->pieces; p++) {
        const size_t from = r->first[p], to = r->first[p + 1];
        const double side = r->side[p], start = p || !r->behind ? 0.0 : r->travelled;
        if (from < to && !(side * (r->x[from] - r->turn[p]) >= start)) return 0;
        size_t falls = 0;
        for (size_t i = from + 1; i < to; i++) falls += side * (r->x[i] - r->x[i - 1]) >= 0.0 ? 0 : 1;
        if (falls) return 0;
    }
    return 1;
}

static int path_fill(mrd_record *r)
{
    r->path = malloc((r->n + 1) * sizeof *r->path);
    if (!r->path) return 0;
    r->path[0] = r->travelled;
    for (size_t p = 0; p < r->pieces; p++) {
        double reached = p || !r->behind ? 0.0 : r->travelled;
        for (size_t i = r->first[p]; i < r->first[p + 1]; i++) {
            const double travel = r->side[p] * (r->x[i] - r->turn[p]);
            if (travel > reached) reached = travel;
            r->path[i] = reached;
        }
    }
    return 1;
}

/* Return the travel from the turning point of piece p to sample i. */
static inline double path_at(const mrd_record *r, size_t p, size_t i)
{
    return r->path ? r->path[i] : r->side[p] * (r->x[i] - r->turn[p]);
}

/* Return the first direction in which the motion leaves its start by more than the dead band; 0 if it has not left. */
static double first_side(const mrd_record *r, double dead_band)
{
    for (size_t i = 1; i < r->known; i++)
        if (fabs(r->x[i] - r->x[0]) > dead_band) return r->x[i] > r->x[0] ? 1.0 : -1.0;
    return 0.0;
}

static mrd_status batch_open(mrd_record *r, size_t n, double step, const double *x, const double *v, const double *a,
                             double dead_band, double longest_step, size_t patience, int last, mrd_motion *motion)
{
    memset(r, 0, sizeof *r);
    r->known = n;
    r->behind = motion->begun != 0.0;
    r->step = step;
    r->x = x;
    r->v = v;
    r->a = a;
    r->longest_step = longest_step;
    r->substeps = (size_t)ceil(step / longest_step - 1e-9);
    if (r->substeps < 1) r->substeps = 1;
    r->travelled = motion->path;

    double side = r->behind ? motion->side : first_side(r, dead_band);
    const int leaves = side != 0.0;
    if (!leaves) side = n && x[n - 1] < x[0] && !last ? -1.0 : 1.0;
    size_t room = 0, extreme = 0;
    int held = piece_begin(r, &room, r->behind, r->behind ? motion->turn : x[0], side);
    /* After a long rest the extreme sample can be in an earlier batch; extreme is then 0. */
    mrd_turns turns = {0};
    turns.side = side;
    turns.furthest = r->behind ? motion->furthest : x[0];
    size_t begun = r->behind && motion->inside == 0.0; /* first sample of the piece; 0 if it began in the last batch */
    for (size_t i = 1; i < n && held; i++) {
        if (!turns_step(&turns, x[i], (double)i, dead_band, 1)) continue;
        extreme = (size_t)turns.turned;
        const double at = r->behind && !extreme ? motion->turns_at : turning_point(r, extreme, side);
        /* The extreme sample is after the reversal if it already moves back. */
        begun = side * v[extreme] < 0.0 && extreme > begun ? extreme : extreme + 1;
        side = turns.side;
        held = piece_begin(r, &room, begun, at, side);
    }
    extreme = (size_t)turns.at;
    if (held) {
        r->n = last ? n : !leaves ? 0 : extreme > r->behind ? extreme : r->behind;
        if (!last && n - r->n > patience) r->n = n;
        r->first[r->pieces] = r->n;
        r->turn[r->pieces] = n ? x[n - 1] : 0.0;
        held = never_falls(r) || path_fill(r);
    }
    if (!held) {
        record_close(r);
        return MRD_NO_MEMORY;
    }
    if (r->n > r->behind) {
        const size_t p = r->pieces - 1;
        motion->begun = 1.0;
        motion->side = side;
        motion->turn = r->turn[p];
        motion->inside = r->first[p] < r->n ? 1.0 : 0.0;
        motion->path = r->first[p] < r->n ? path_at(r, p, r->n - 1) : 0.0;
        if (!r->behind || extreme) motion->turns_at = turning_point(r, extreme, side);
        motion->furthest = turns.furthest;
    }
    return MRD_OK;
}

static mrd_status record_open(mrd_record *r, size_t n, double step, const double *x, const double *v, const double *a,
                              double dead_band, double longest_step)
{
    mrd_motion whole;
    memset(&whole, 0, sizeof whole);
    return batch_open(r, n, step, x, v, a, dead_band, longest_step, 0, 1, &whole);
}
