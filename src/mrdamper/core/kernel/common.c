/* Terms common to all laws: viscous force, spring, offset, inertia, Stribeck friction.
 *
 * Three functions of velocity are expensive: a power, an exponential, and a hyperbolic tangent. They are computed once
 * for a record. The force and all its partial derivatives use the same values.
 */

/* Return true for laws with spring and offset inside their series connection. */
static inline int has_own_spring(mrd_law law) { return law == MRD_SERIES_VALVE || law == MRD_CHAIN_LAW; }

static inline double tanh_of(double u)
{
    const double decay = exp(-2.0 * fabs(u)), size = (1.0 - decay) / (1.0 + decay);
    return u < 0.0 ? -size : size;
}

/* Return v |v / v0|^(exponent - 1), with v0 = MRD_VISCOUS_SPEED. */
static inline double viscous_speed(double v, double exponent)
{
    if (exponent == 1.0 || v == 0.0) return v;
    return v * exp((exponent - 1.0) * log(fabs(v) / MRD_VISCOUS_SPEED));
}

static inline double stribeck_fade(const mrd_model *m, double v, size_t i)
{
    const double ratio = v / coefficient_at(m, C_STRIBECK, i);
    return exp(-ratio * ratio);
}

static inline double friction_side(const mrd_model *m, double v, size_t i)
{
    return tanh_of(v / coefficient_at(m, C_TRANSITION, i));
}

static int has_friction(const mrd_model *m, size_t n)
{
    for (size_t i = 0; i < (m->stride ? n : 1); i++)
        if (coefficient_at(m, C_COULOMB, i) != 0.0 || coefficient_at(m, C_BREAKAWAY, i) != 0.0) return 1;
    return 0;
}

/* Return the force of the common terms at one sample. */
static inline double common_force(const mrd_model *m, const mrd_record *r, size_t i)
{
    const double v = r->v[i], viscosity = coefficient_at(m, C_VISCOSITY, i);
    double f = coefficient_at(m, C_MASS, i) * r->a[i];
    if (viscosity != 0.0) f += viscosity * viscous_speed(v, coefficient_at(m, C_VISCOUS_EXPONENT, i));
    if (!has_own_spring(m->law)) f += coefficient_at(m, C_STIFFNESS, i) * r->x[i] + coefficient_at(m, C_OFFSET, i);
    const double coulomb = coefficient_at(m, C_COULOMB, i), breakaway = coefficient_at(m, C_BREAKAWAY, i);
    if (coulomb != 0.0 || breakaway != 0.0)
        f += (coulomb + breakaway * stribeck_fade(m, v, i)) * friction_side(m, v, i);
    return f;
}

/* Values along a record that the force and its partial derivatives share. Unused rows are NULL. */
typedef struct {
    const double *power; /* v |v / v0|^(exponent - 1) */
    double *fade, *side; /* Stribeck factor and sign of the friction */
    double *store;
} common_rows;

static mrd_status common_open(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction,
                              common_rows *rows)
{
    int viscous = 0, friction = has_friction(m, r->n);
    for (size_t d = 0; d < directions; d++) {
        const int k = direction[d].coefficient;
        viscous |= k == C_VISCOSITY || k == C_VISCOUS_EXPONENT;
        friction |= k == C_COULOMB || k == C_BREAKAWAY || k == C_STRIBECK || k == C_TRANSITION;
    }
    for (size_t i = 0; !viscous && i < (m->stride ? r->n : 1); i++) viscous = coefficient_at(m, C_VISCOSITY, i) != 0.0;
    rows->fade = rows->side = NULL;
    rows->power = NULL;
    rows->store = malloc((3 * r->n + 1) * sizeof *rows->store);
    if (!rows->store) return MRD_NO_MEMORY;
    if (viscous) {
        const int bent = m->stride || coefficient_at(m, C_VISCOUS_EXPONENT, 0) != 1.0;
        double *power = rows->store;
        for (size_t i = 0; bent && i < r->n; i++)
            power[i] = viscous_speed(r->v[i], coefficient_at(m, C_VISCOUS_EXPONENT, i));
        rows->power = bent ? power : r->v;
    }
    if (friction) {
        rows->fade = rows->store + r->n;
        rows->side = rows->store + 2 * r->n;
        for (size_t i = 0; i < r->n; i++) rows->fade[i] = stribeck_fade(m, r->v[i], i);
        for (size_t i = 0; i < r->n; i++) rows->side[i] = friction_side(m, r->v[i], i);
    }
    return MRD_OK;
}

static void common_close(common_rows *rows) { free(rows->store); }

/* Add the force of the common terms along a record; `step` is 1 if coefficients vary, otherwise 0. */
static inline void common_add_of(const mrd_model *m, const mrd_record *r, const common_rows *rows, size_t step,
                                 double *restrict force)
{
    const size_t row = step ? m->stride : 1;
    const double *mass = m->coefficient + C_MASS * row, *viscosity = m->coefficient + C_VISCOSITY * row;
    const double *stiffness = m->coefficient + C_STIFFNESS * row, *offset = m->coefficient + C_OFFSET * row;
    const double *coulomb = m->coefficient + C_COULOMB * row, *breakaway = m->coefficient + C_BREAKAWAY * row;
    const int chain = has_own_spring(m->law);
    for (size_t i = 0; i < r->n; i++) {
        double f = mass[step * i] * r->a[i];
        if (rows->power) f += viscosity[step * i] * rows->power[i];
        if (!chain) f += stiffness[step * i] * r->x[i] + offset[step * i];
        if (rows->side) f += (coulomb[step * i] + breakaway[step * i] * rows->fade[i]) * rows->side[i];
        force[i] += f;
    }
}

static void common_add(const mrd_model *m, const mrd_record *r, const common_rows *rows, double *force)
{
    if (m->stride) common_add_of(m, r, rows, 1, force);
    else common_add_of(m, r, rows, 0, force);
}

/* Compute the derivative of the force along a direction of a common coefficient, for every sample of a record. */
static void common_column(const mrd_model *m, const mrd_record *r, const common_rows *rows, const mrd_direction *d,
                          double *restrict column)
{
    const double *restrict side = rows->side, *restrict fade = rows->fade, *restrict power = rows->power;
    const size_t n = r->n;
    switch (d->coefficient) {
    case C_VISCOSITY: memcpy(column, power, n * sizeof *column); break;
    case C_MASS: memcpy(column, r->a, n * sizeof *column); break;
    case C_STIFFNESS: memcpy(column, r->x, n * sizeof *column); break;
    case C_COULOMB: memcpy(column, side, n * sizeof *column); break;
    case C_OFFSET:
        for (size_t i = 0; i < n; i++) column[i] = 1.0;
        break;
    case C_BREAKAWAY:
        for (size_t i = 0; i < n; i++) column[i] = fade[i] * side[i];
        break;
    case C_STRIBECK:
        for (size_t i = 0; i < n; i++) {
            const double v = r->v[i], vs = coefficient_at(m, C_STRIBECK, i);
            column[i] = coefficient_at(m, C_BREAKAWAY, i) * fade[i] * side[i] * 2.0 * v * v / (vs * vs * vs);
        }
        break;
    case C_TRANSITION:
        for (size_t i = 0; i < n; i++) {
            const double vt = coefficient_at(m, C_TRANSITION, i);
            const double level = coefficient_at(m, C_COULOMB, i) + coefficient_at(m, C_BREAKAWAY, i) * fade[i];
            column[i] = -level * (1.0 - side[i] * side[i]) * r->v[i] / (vt * vt);
        }
        break;
    default: /* C_VISCOUS_EXPONENT */
        for (size_t i = 0; i < n; i++) {
            const double size = fabs(r->v[i]);
            column[i] = size > 0.0 ? coefficient_at(m, C_VISCOSITY, i) * power[i] * log(size / MRD_VISCOUS_SPEED) : 0.0;
        }
    }
    if (d->seed)
        for (size_t i = 0; i < n; i++) column[i] *= d->seed[d->stride * i];
}
