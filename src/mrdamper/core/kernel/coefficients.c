/* Coefficients of a model and seeds of a direction: value at a sample, and mean over a sample interval. */

static inline double coefficient_at(const mrd_model *m, int k, size_t i)
{
    return m->stride ? m->coefficient[(size_t)k * m->stride + i] : m->coefficient[k];
}

static inline int varies(const mrd_model *m, int k, size_t n)
{
    if (!m->stride) return 0;
    const double *row = m->coefficient + (size_t)k * m->stride;
    for (size_t i = 1; i < n; i++)
        if (row[i] != row[0]) return 1;
    return 0;
}

/* Return the mean over the sample interval that ends at sample i; at the ends of a row, the first or last value. */
static inline double interval_mean(const double *row, size_t stride, size_t i, size_t n)
{
    if (i == 0 || i >= n) return row[stride * (i ? n - 1 : 0)];
    return 0.5 * (row[stride * (i - 1)] + row[stride * i]);
}

static inline double coefficient_mean(const mrd_model *m, int k, size_t i, size_t n)
{
    return m->stride ? interval_mean(m->coefficient + (size_t)k * m->stride, 1, i, n) : m->coefficient[k];
}

static inline double seed_at(const mrd_direction *d, size_t i) { return d->seed ? d->seed[d->stride * i] : 1.0; }

static inline double seed_mean(const mrd_direction *d, size_t i, size_t n)
{
    return d->seed ? interval_mean(d->seed, d->stride, i, n) : 1.0;
}
