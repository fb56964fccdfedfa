/* The Bouc-Wen family along a record: exact flow from turning point to turning point.
 *
 * All samples between two reversals are independent (w = Y(tau_start + rho travel)); the only
 * recurrence is one inverse of the curve per reversal.
 */

#define BLOCK 256

/* w of one monotone stretch: out = side Y(start + scaled travel). travel never falls, so the fall
 * branch (tau < 0) is a prefix of the stretch. */
static void curve_stretch(const curve *c, double start, double rho, double side, size_t n, const double *restrict travel,
                          double *restrict w)
{
    size_t split = 0;
    if (start < 0.0) {
        size_t high = n;
        while (split < high) {
            const size_t middle = (split + high) / 2;
            if (start + rho * travel[middle] < 0.0) split = middle + 1;
            else high = middle;
        }
    }
    {
        const double *restrict cell = c->fall.cell;
        const double offset = c->fall.offset - start, top = c->fall.top;
        const uint64_t base = c->fall.base;
        const int shift = c->fall.shift;
        for (size_t i = 0; i < split; i++) {
            double t = offset - rho * travel[i];
            t = t < top ? t : top;
            w[i] = -side * cubic_at(cell, base, shift, t);
        }
    }
    {
        const double *restrict cell = c->rise.cell;
        const double offset = c->rise.offset + start, top = c->rise.top;
        const uint64_t base = c->rise.base;
        const int shift = c->rise.shift;
        for (size_t i = split; i < n; i++) {
            double t = offset + rho * travel[i];
            t = t < top ? t : top;
            w[i] = side * cubic_at(cell, base, shift, t);
        }
    }
}

/* tau at the start of the next piece, from tau at the end of this one. */
static double turned(const curve *c, double tau_end)
{
    return curve_inverse(c, -curve_at(c, tau_end).w);
}

/* w along a record at constant rho. */
static void bouc_wen_state(const curve *c, const mrd_record *r, double rho, double *w)
{
    double start = 0.0;
    for (size_t p = 0; p < r->pieces; p++) {
        const size_t from = r->first[p], to = r->first[p + 1];
        curve_stretch(c, start, rho, r->side[p], to - from, r->path + from, w + from);
        start = turned(c, start + rho * fabs(r->turn[p + 1] - r->turn[p]));
    }
}

/* w and its derivatives along a record.
 *
 * rho may vary from sample to sample (stride 1); the travel is then weighted with its mean over each sample
 * interval, which errs with the square of the step. `ways` directions move rho with the given seeds;
 * by_rho[d] holds dw for each, by_n and by_kappa dw for a unit change of n and kappa.
 */
static void bouc_wen_tangents(const curve *c, const mrd_record *r, const double *rho, size_t stride, size_t ways,
                              const mrd_direction *const *way, double *w, double *const *by_rho, double *by_n,
                              double *by_kappa)
{
    double start = 0.0, start_n = 0.0, start_k = 0.0, start_rho[MRD_DIRECTIONS], travel_rho[MRD_DIRECTIONS];
    for (size_t d = 0; d < ways; d++) start_rho[d] = 0.0;

    for (size_t p = 0; p < r->pieces; p++) {
        const double side = r->side[p];
        double travel = 0.0, last = 0.0;
        for (size_t d = 0; d < ways; d++) travel_rho[d] = 0.0;
        size_t i = r->first[p];
        for (; i < r->first[p + 1]; i++) {
            const double moved = r->path[i] - last;
            last = r->path[i];
            travel += interval_mean(rho, stride, i, r->n) * moved;
            const curve_point at = curve_at(c, start + travel);
            w[i] = side * at.w;
            for (size_t d = 0; d < ways; d++) {
                travel_rho[d] += seed_mean(way[d], i, r->n) * moved;
                by_rho[d][i] = side * at.slope * (start_rho[d] + travel_rho[d]);
            }
            if (by_n) by_n[i] = side * (at.by_n + at.slope * start_n);
            if (by_kappa) by_kappa[i] = side * (at.by_kappa + at.slope * start_k);
        }
        /* The rest of the way to the turning point, and over it. */
        const double rest = p + 1 < r->pieces ? fabs(r->turn[p + 1] - r->turn[p]) - last : 0.0;
        travel += interval_mean(rho, stride, i, r->n) * rest;
        const curve_point end = curve_at(c, start + travel);
        start = curve_inverse(c, -end.w);
        const curve_point begin = curve_at(c, start);
        const double scale = begin.slope > 1e-9 ? 1.0 / begin.slope : 0.0;
        for (size_t d = 0; d < ways; d++) {
            travel_rho[d] += seed_mean(way[d], i, r->n) * rest;
            start_rho[d] = -end.slope * (start_rho[d] + travel_rho[d]) * scale;
        }
        start_n = (-(end.by_n + end.slope * start_n) - begin.by_n) * scale;
        start_k = (-(end.by_kappa + end.slope * start_k) - begin.by_kappa) * scale;
    }
}
