/* Numbers out of a fuzzer's bytes: ordinary ones for the most part, and every double that there is. */
#ifndef FUZZ_BYTES_H
#define FUZZ_BYTES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const uint8_t *at;
    size_t left;
} bytes;

static uint8_t next(bytes *b)
{
    if (!b->left) return 0;
    b->left--;
    return *b->at++;
}

/* From 0 to 1, both included. */
static double share(bytes *b)
{
    const unsigned high = next(b), low = next(b);
    return (double)(high * 256u + low) / 65535.0;
}

static double between(bytes *b, double low, double high) { return low + (high - low) * share(b); }

static double over_decades(bytes *b, double low, double high) { return exp(between(b, log(low), log(high))); }

/* Any double: eight bytes of its own, or one of those where things change. */
static double any(bytes *b)
{
    static const double odd[] = {0.0, -0.0, 1.0, -1.0, 4.9e-324, 2.2e-308, 1e-30, 1e-9, 1e9, 2147483648.0, 9.3e18, 1e30,
                                 1.7e308, -1.7e308, HUGE_VAL, -HUGE_VAL, NAN, 0.5, 273.15, 1e-3};
    const uint8_t kind = next(b);
    if (kind < 64) return odd[kind % (sizeof odd / sizeof *odd)];
    if (kind < 192) return ((int)next(b) - 128) * pow(10.0, (int)(kind % 16) - 10);
    uint8_t raw[8];
    double value;
    for (int k = 0; k < 8; k++) raw[k] = next(b);
    memcpy(&value, raw, sizeof value);
    return value;
}

static void promise(int kept, const char *said, double value)
{
    if (kept) return;
    fprintf(stderr, "promise broken: %s (%.17g)\n", said, value);
    abort();
}

#endif
