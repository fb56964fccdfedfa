/* The controller in one precision behind doubles; included once per precision.
 *
 * TRACK(name) is the kernel's function of that name. Numbers and readings are rounded on the way in.
 */

/* A controller and what it may point to. */
typedef struct {
    mrd_track track;
    mrd_series series;
} track_room;

static int lookups_are_sound(const mrd_lookup *lookups, int count)
{
    for (int k = 0; k < count; k++) {
        const mrd_lookup *o = lookups + k;
        if (!(o->offset > (mrd_real)0 && o->bits >= 0 && o->bits <= 10 && o->cells > 0)) return 0;
        /* the last cell that can be read is the last there is */
        mrd_real end = o->offset;
        int32_t cells = 0;
        while (cells < o->cells && cells < (1 << 20)) {
            cells += 1 << o->bits;
            end *= (mrd_real)2;
        }
        if (cells != o->cells || !(o->top >= o->offset && o->top < end)) return 0;
    }
    return 1;
}

/* The same as below of the series valve's numbers and tables. */
static int series_is_sound(const mrd_track *t)
{
    const mrd_real one = 1;
    const mrd_series *series = t->series;
    const int32_t cells = series->currents - 1;
    if (cells < 1 || cells > 1024 || (cells & (cells - 1))) return 0;
    if (t->law.substeps < 1 || t->law.substeps > 1000) return 0;
    const mrd_power *powers = &series->thinning;
    for (int k = 0; k < SERIES_POWERS; k++) {
        const mrd_power *p = powers + k;
        if (!(p->lowest >= (mrd_real)1e-30 && p->lowest <= one) || p->octaves < 1 || p->octaves > 100) return 0;
        mrd_real end = one;
        while (end > p->lowest) end /= (mrd_real)2;
        if (end != p->lowest) return 0; /* no power of two */
        for (int32_t octave = 0; octave < p->octaves; octave++) end *= (mrd_real)2;
        if (!(p->top >= p->lowest && p->top < end)) return 0;
    }
    return lookups_are_sound(&series->side, SERIES_LOOKUPS);
}

/* Everything that the step relies on without looking: shapes, and numbers that become indices. */
static int track_is_sound(const mrd_track *t)
{
    const mrd_real zero = 0, one = 1;
    const int32_t dead = t->actuation.dead_samples;
    if (!(t->axes.period > zero && t->axes.largest > zero && t->axes.coldest > zero
          && t->axes.warmest >= t->axes.coldest))
        return 0;
    if (t->law.elements < 0 || t->law.elements > 2) return 0;
    if (t->inverse.bank && (t->inverse.preview > zero || t->law.series || t->law.chain)) return 0;
    if (!(t->gains.yield_force > zero && t->gains.viscous_force > zero && t->gains.friction_force > zero)) return 0;
    if (dead < 0 || dead > (int32_t)MRD_TRACK_DELAY_LINE - 3) return 0;
    if (!(t->actuation.dead_part >= zero && t->actuation.dead_part <= one)) return 0;
    if (!(t->inverse.preview >= zero && t->faults.fall_back >= zero && t->faults.speed_limit > zero)) return 0;
    if (!(t->heating.heat_capacity >= zero && t->heating.loss_conductance >= zero && t->heating.loss_ratio_max >= zero)) return 0;
    if (t->currents < 2 || t->currents > MRD_TRACK_CURRENTS || t->pieces < 1 || !(t->law.unloaded >= zero)) return 0;
    if (t->prediction.steps < 0 || t->prediction.steps > MRD_TRACK_STEPS || t->prediction.together < 1) return 0;
    if (t->prediction.stretch < 1 || t->prediction.stretch > MRD_TRACK_STEPS) return 0;
    if (t->prediction.samples < 1 || t->prediction.samples > MRD_TRACK_STEPS) return 0;
    if (!(t->prediction.step >= zero && t->prediction.dead >= zero)) return 0;
    return lookups_are_sound(&t->loading, TRACK_LOOKUPS)
        && (t->series ? series_is_sound(t) : !t->law.series && !t->law.chain);
}

static mrd_real *rounded(mrd_real *to, const double *from, size_t count)
{
    for (size_t i = 0; i < count; i++) *to++ = (mrd_real)from[i];
    return to;
}

static void load_series(mrd_series *into, mrd_real *to, const tracker_parts *parts)
{
    mrd_power *powers = &into->thinning;
    mrd_lookup *lookups = &into->side;
    const mrd_real *at[SERIES_TABLES];
    for (int k = 0; k < SERIES_TABLES; k++) {
        at[k] = to;
        to = rounded(to, parts->series_table[k], parts->series_length[k]);
    }
    into->currents = parts->series_currents;
    into->yield = at[0];
    into->chain = at[1];
    for (int k = 0; k < SERIES_POWERS; k++) {
        mrd_power *p = powers + k;
        p->exponent = (mrd_real)parts->exponent[k];
        p->lowest = (mrd_real)parts->least[k];
        p->top = (mrd_real)parts->power_top[k];
        p->bits = parts->power_bits[k];
        p->octaves = (int32_t)parts->series_length[2 + 2 * k];
        p->scale = at[2 + 2 * k];
        p->cell = at[3 + 2 * k];
    }
    for (int k = 0; k < SERIES_LOOKUPS; k++) {
        mrd_lookup *o = lookups + k;
        o->offset = (mrd_real)parts->series_offset[k];
        o->top = (mrd_real)parts->series_top[k];
        o->bits = parts->series_bits[k];
        o->cells = (int32_t)(parts->series_length[2 + 2 * SERIES_POWERS + k] / 4);
        o->cell = at[2 + 2 * SERIES_POWERS + k];
    }
}

/* The rows of the terms, levels first, then the columns in order; where each group of columns begins. */
static int place_terms(mrd_track *t, const tracker_parts *parts)
{
    static const int last[MRD_GROUPS] = {MRD_ROW_YIELD, MRD_ROW_SECOND, MRD_ROW_RHO, MRD_ROW_SECOND_RHO, MRD_TABLE_ROWS};
    t->levels = parts->terms - parts->columns;
    if (parts->terms > MRD_TRACK_TERMS || t->levels < 0) return 0;
    for (int32_t k = 0; k < parts->terms; k++) {
        const int row = parts->row[k], is_level = k < t->levels;
        /* the yield forces and rho have columns even where the current does not move them */
        if (row >= (is_level ? MRD_ROW_YIELD : MRD_TABLE_ROWS) || (k > t->levels && row < parts->row[k - 1])) return 0;
        t->row[k] = (uint8_t)row;
        for (int g = 0; !is_level && g < MRD_GROUPS; g++) t->begin[g + 1] += row < last[g];
    }
    return 1;
}

/* The currents rise from 0 to the largest, and its quarters are among them, within rounding. */
static int place_currents(mrd_track *t, const double *current)
{
    const int32_t last = t->currents - 1;
    int32_t j = 0;
    if (last < 1 || current[0] != 0.0) return 0;
    const double near = 1e-9 * current[last];
    for (int k = 0; k < MRD_TRACK_BANK; k++) {
        const double quarter = current[last] * k / (MRD_TRACK_BANK - 1);
        for (; j < last && current[j] < quarter - near; j++)
            if (!(current[j + 1] > current[j])) return 0;
        if (!(current[j] >= quarter - near && current[j] <= quarter + near)) return 0;
        t->quarter[k] = (uint8_t)j;
    }
    return j == last && (mrd_real)current[last] == t->axes.largest;
}

/* Whether a number can become a value of a type of the configuration. */
#define FITS_mrd_real(v) 1
#define FITS_int32_t(v) ((v) >= 0.0 && (v) <= 1e9)
#define FITS_bool(v) ((v) == 0.0 || (v) == 1.0)
#define FITS_mrd_inverse_method(v) ((v) == 0.0 || (v) == 1.0 || (v) == 2.0)
#define FITS_mrd_feedback_kind(v) ((v) == 0.0 || (v) == 1.0 || (v) == 2.0)

static int face_load(void *into, void *store, const tracker_parts *parts)
{
    mrd_track *t = into;
    mrd_lookup *lookups = &t->loading;
    mrd_real *to = store;
    const double *value = parts->config;
    memset(t, 0, sizeof *t);
#define X(part, name, type) \
    if (!FITS_##type(*value)) return 0; \
    t->part.name = (type)*value++;
    MRD_CONFIG_VALUES(X)
#undef X
    t->pieces = parts->pieces;
    t->currents = parts->currents;
    if (!place_terms(t, parts) || !place_currents(t, parts->table[0])) return 0;
    for (int k = 0; k < TRACK_TABLES; k++) {
        if (k == 0) t->current = to;
        else if (k == 1) t->factor = to;
        else if (k == 2) t->column = to;
        else {
            mrd_lookup *o = lookups + (k - 3);
            o->offset = (mrd_real)parts->offset[k - 3];
            o->top = (mrd_real)parts->top[k - 3];
            o->bits = parts->bits[k - 3];
            o->cells = (int32_t)(parts->length[k] / 4);
            o->cell = to;
        }
        to = rounded(to, parts->table[k], parts->length[k]);
    }
    if (parts->series) {
        if (parts->series_sheets != (t->axes.warmest > t->axes.coldest ? t->pieces + 1 : 1)) return 0;
        if (parts->series_planes != (t->law.chain ? (int32_t)MRD_PLANES : 1)) return 0;
        if (parts->series_rows != (t->law.chain ? (int32_t)MRD_CHAIN_ALL : (int32_t)MRD_CHAIN)) return 0;
        mrd_series *series = &((track_room *)into)->series;
        load_series(series, to, parts);
        t->series = series;
    }
    return track_is_sound(t);
}

static int face_is_sound(const void *state)
{
    const mrd_track_state *s = state;
    return s->newest_command >= 0 && s->newest_command < (int32_t)MRD_TRACK_DELAY_LINE && s->prediction_samples >= 0 && s->prediction_samples < MRD_TRACK_STEPS;
}

static void face_start(const void *track, void *state) { TRACK(start)(track, state); }

static double face_step(const void *track, void *state, const double *inputs)
{
    const mrd_inputs at = {(mrd_real)inputs[0], (mrd_real)inputs[1], (mrd_real)inputs[2], (mrd_real)inputs[3], (mrd_real)inputs[4]};
    return (double)TRACK(step)(track, state, &at);
}

static double face_model(const void *track, void *state, const double *inputs)
{
    const mrd_model_inputs at = {(mrd_real)inputs[0], (mrd_real)inputs[1], (mrd_real)inputs[2], (mrd_real)inputs[3]};
    return (double)TRACK_MODEL(track, state, &at);
}

static int32_t face_flags(const void *state) { return ((const mrd_track_state *)state)->flags; }

static void face_read(const void *track, const void *state, double *out)
{
    const mrd_track_state *s = state;
    mrd_real parts[4];
    TRACK(parts)(track, s, parts);
    const mrd_real values[TRACK_READ] = {s->x, s->v, s->a, s->applied_current, s->command, s->temperature, s->disturbance,
                                         parts[0], parts[1], parts[2], parts[3], s->expected_rise};
    for (int k = 0; k < TRACK_READ; k++) out[k] = (double)values[k];
}

static const tracker_face face = {sizeof(track_room), sizeof(mrd_track_state), sizeof(mrd_real), face_load, face_is_sound,
                                  face_start, face_step, face_model, face_flags, face_read};
