/* A controller behind doubles: what the binding sees of the kernel's step, in double or in single precision.
 *
 * tracker_face.c is the other side of it, once per precision: its mrd_real is not the same in the two.
 */
#ifndef MRD_TRACKER_H
#define MRD_TRACKER_H

#include <stddef.h>
#include <stdint.h>

#define TRACK_LOOKUPS 9
#define TRACK_TABLES (3 + TRACK_LOOKUPS) /* currents, factors, columns, and the cells of every function */
#define TRACK_READ 15                    /* values of `read` */
#define SERIES_POWERS 4                  /* of series valve and chain: thinning, leak, viscous, gas */
#define SERIES_LOOKUPS 2                 /* ... side, fade */
#define SERIES_TABLES (2 + 2 * SERIES_POWERS + SERIES_LOOKUPS) /* yield, chain, scale and cells of each power, cells */

/* What a controller is made of. */
typedef struct {
    const double *config; /* of MRD_CONFIG_VALUES */
    int32_t currents, columns, pieces, terms;
    const uint8_t *row; /* of each term, levels first */
    const double *table[TRACK_TABLES];
    size_t length[TRACK_TABLES];
    double offset[TRACK_LOOKUPS], top[TRACK_LOOKUPS];
    int32_t bits[TRACK_LOOKUPS];
    int32_t series; /* 1: what follows is there */
    int32_t series_currents, series_sheets; /* of its yield force; sheets over temperature */
    int32_t series_planes, series_rows;     /* of what the current moves; of the other coefficients */
    const double *series_table[SERIES_TABLES];
    size_t series_length[SERIES_TABLES];
    double exponent[SERIES_POWERS], least[SERIES_POWERS], power_top[SERIES_POWERS];
    int32_t power_bits[SERIES_POWERS];
    double series_offset[SERIES_LOOKUPS], series_top[SERIES_LOOKUPS];
    int32_t series_bits[SERIES_LOOKUPS];
} tracker_parts;

typedef struct {
    size_t track_size, state_size, real_size;
    /* Fills a controller from its parts, rounded; `store` has room for all tables. 0: out of their range. */
    int (*load)(void *track, void *store, const tracker_parts *parts);
    int (*is_sound)(const void *state); /* bytes may come from anywhere */
    void (*start)(const void *track, void *state);
    double (*step)(const void *track, void *state, const double *inputs);    /* of mrd_inputs */
    double (*model)(const void *track, void *state, const double *driven); /* of mrd_model_inputs */
    int32_t (*flags)(const void *state);
    /* motion (3), applied, command, temperature, gains (3), disturbance, parts (4), energy account [K] */
    void (*read)(const void *track, const void *state, double *out);
} tracker_face;

const tracker_face *mrd_tracker_single(void);

#endif
