/* A sample interval of the implicit laws: motion, coefficients and directions. Coefficients can vary along a run
 * only if there is one lane. */

#define VARYING (PACK == 1)
#define WAYS_MAX (PACK == 1 ? MRD_DIRECTIONS : CH_COUNT)

typedef struct {
    pack step;
    size_t substeps;
    const pack *x, *v;       /* [2] displacement and velocity at both ends */
    const pack *from, *to;   /* coefficients at both ends if they vary, else NULL */
    size_t ways;
    const int *way;          /* coefficient of each direction of differentiation */
    const pack *seed_from, *seed_to; /* seeds of the directions at both ends; NULL: 1 */
} lane_samples;

/* Motion between two samples: the cubic Hermite interpolant. */
typedef struct {
    pack x, d, c2, c3, per_step;
} lane_motion;

IN_LANES lane_motion motion_between(const lane_samples *t)
{
    const pack d0 = t->v[0] * t->step, d1 = t->v[1] * t->step, way = t->x[1] - t->x[0];
    const lane_motion out = {t->x[0], d0, 3.0 * way - 2.0 * d0 - d1, d0 + d1 - 2.0 * way, 1.0 / t->step};
    return out;
}

/* Compute displacement and velocity at a fraction of the interval. */
IN_LANES void motion_at(const lane_motion *m, double fraction, pack *x, pack *v)
{
    *x = m->x + fraction * (m->d + fraction * (m->c2 + fraction * m->c3));
    *v = (m->d + fraction * (2.0 * m->c2 + fraction * 3.0 * m->c3)) * m->per_step;
}

/* Interpolate varying coefficients at a fraction of the interval. Return 0 if they are constant. */
IN_LANES int coefficients_between(const lane_samples *t, double fraction, int count, pack *c)
{
    if (!VARYING || !t->to) return 0;
    for (int k = 0; k < count; k++) c[k] = t->from[k] + fraction * (t->to[k] - t->from[k]);
    return 1;
}

IN_LANES pack seed_between(const lane_samples *t, size_t d, double fraction)
{
    if (!VARYING || !t->seed_to) return pack_of(1.0);
    return t->seed_from[d] + fraction * (t->seed_to[d] - t->seed_from[d]);
}
