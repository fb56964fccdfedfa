/* Fuzzing of a controller's tables: its configuration, shapes and cells of sound ones altered, then steps.
 *
 * What is refused is refused; what is taken steps without a report of the sanitizers, whatever comes of it. The
 * tables are those that the Python package hands to its binding (parts.h is made from them).
 */
#include "kernel.c"

#define TRACK(name) mrd_track_##name
#define TRACK_MODEL mrd_model_step
#include "tracker.h"
#include "tracker_face.c"

#include "bytes.h"
#include "parts.h"

#define MOST_EDITS 6
#define MOST_STEPS 24

/* A table of its own, exactly as long as said, so that a read past its end is seen. */
static double *copied(const double *from, size_t count)
{
    double *made = malloc((count ? count : 1) * sizeof *made);
    if (!made) exit(0);
    memcpy(made, from, count * sizeof *made);
    return made;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes b = {data, size};
    tracker_parts parts = *(const tracker_parts *)all_parts[next(&b) % PARTS];
    double *config = copied(parts.config, CONFIG_VALUES), *table[TRACK_TABLES], *series[SERIES_TABLES];
    uint8_t row[MRD_TRACK_TERMS];
    size_t total = 0;
    memcpy(row, parts.row, (size_t)parts.terms);
    for (int k = 0; k < TRACK_TABLES; k++) table[k] = copied(parts.table[k], parts.length[k]), total += parts.length[k];
    for (int k = 0; k < SERIES_TABLES; k++)
        series[k] = parts.series ? copied(parts.series_table[k], parts.series_length[k]) : NULL,
        total += parts.series ? parts.series_length[k] : 0;
    const int edits = next(&b) % MOST_EDITS;
    for (int e = 0; e < edits; e++) {
        const int k = next(&b);
        switch (next(&b) % 8) {
        case 0: case 1: case 2: config[k % CONFIG_VALUES] = any(&b); break;
        case 3: if (parts.length[k % TRACK_TABLES]) table[k % TRACK_TABLES][(size_t)next(&b) * 7 % parts.length[k % TRACK_TABLES]] = any(&b); break;
        case 4: parts.bits[k % TRACK_LOOKUPS] = (int32_t)next(&b) - 4; break;
        case 5: parts.offset[k % TRACK_LOOKUPS] = any(&b); break;
        case 6: parts.top[k % TRACK_LOOKUPS] = any(&b); break;
        default: row[k % parts.terms] = next(&b); break;
        }
        if (parts.series && next(&b) % 4 == 0) {
            const int s = next(&b);
            switch (next(&b) % 4) {
            case 0: parts.exponent[s % SERIES_POWERS] = any(&b); break;
            case 1: parts.least[s % SERIES_POWERS] = any(&b); break;
            case 2: parts.power_top[s % SERIES_POWERS] = any(&b); break;
            default: series[s % SERIES_TABLES][(size_t)next(&b) * 5 % parts.series_length[s % SERIES_TABLES]] = any(&b); break;
            }
        }
    }
    parts.config = config;
    parts.row = row;
    for (int k = 0; k < TRACK_TABLES; k++) parts.table[k] = table[k];
    for (int k = 0; k < SERIES_TABLES; k++) parts.series_table[k] = series[k];
    void *track = malloc(face.track_size), *store = malloc(total * face.real_size);
    if (track && store && face.load(track, store, &parts)) {
        mrd_track_state state;
        double read[TRACK_READ];
        face.start(track, &state);
        for (int k = 0; k < MOST_STEPS && b.left; k++) {
            double told[5];
            for (int i = 0; i < 5; i++) told[i] = any(&b);
            if (next(&b) % 2) {
                face.step(track, &state, told);
            } else {
                face.model(track, &state, told);
            }
            face.read(track, &state, read);
            promise(face.is_sound(&state), "a step leaves a sound state", k);
        }
    }
    free(store);
    free(track);
    free(config);
    for (int k = 0; k < TRACK_TABLES; k++) free(table[k]);
    for (int k = 0; k < SERIES_TABLES; k++) free(series[k]);
    return 0;
}
