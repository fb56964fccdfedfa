/* Turning points of a motion: extremes after which the displacement returns by more than a dead band.
 *
 * Samples are processed one by one, so that the result does not depend on batches.
 */

/* Process sample `i` of the motion. Return 1 if this sample shows that the motion has turned, at sample `turned`.
 *
 * While `side` is 0, the motion has not left its start by more than the dead band. Both extremes are then stored, the
 * upper extreme in `furthest`. The turning point is the first of several consecutive equal extremes, or the last if
 * `latest` is set.
 */
static inline int turns_step(mrd_turns *t, double x, double i, double dead_band, int latest)
{
    if (t->side == 0.0) {
        if (x > t->furthest) {
            t->furthest = x;
            t->at = i;
        }
        if (x < t->lowest) {
            t->lowest = x;
            t->lowest_at = i;
        }
        const int falls = t->furthest - x > dead_band;
        if (!falls && !(x - t->lowest > dead_band)) return 0;
        t->turned = falls ? t->at : t->lowest_at;
        t->side = falls ? -1.0 : 1.0;
    } else {
        if (t->side * x > t->side * t->furthest || (latest && x == t->furthest)) {
            t->furthest = x;
            t->at = i;
            return 0;
        }
        if (!(t->side * (t->furthest - x) > dead_band)) return 0;
        t->turned = t->at;
        t->side = -t->side;
    }
    t->furthest = x;
    t->at = i;
    return t->turned >= 0.0;
}

/* Process the next n samples. Write the indices of the turning points to `at` [n], and return their number. Indices
 * count from the first sample of the motion, which is not a turning point. */
static size_t turns_feed(mrd_turns *t, size_t n, const double *x, double dead_band, double *at)
{
    size_t count = 0;
    for (size_t k = 0; k < n; k++) {
        if (t->taken == 0.0) {
            t->furthest = t->lowest = x[k];
            t->at = t->lowest_at = -1.0;
        } else if (turns_step(t, x[k], t->taken, dead_band, 0)) {
            at[count++] = t->turned;
        }
        t->taken += 1.0;
    }
    return count;
}
