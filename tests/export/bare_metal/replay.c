/* Step a controller through given readings, and print the duration of the steps and a hash of the outputs.
 *
 * STEPS is the number of steps; MRD_SINGLE has the same meaning as in the kernel. The program prints one line: shortest
 * step, all steps, longest step [timer ticks without reading the timer], index of the longest step, stack [bytes],
 * hash, and number of steps whose command is NaN or not between 0 and the largest command.
 */
#include "board.h"
#include "one.h"

extern const mrd_real rows[STEPS][5];

static mrd_track_state state;

static void put_number(uint64_t value, const char *after)
{
    char text[24];
    int at = 23;
    text[at] = '\0';
    do {
        text[--at] = (char)('0' + (int)(value % 10u));
        value /= 10u;
    } while (value != 0u);
    board_put(text + at);
    board_put(after);
}

/* Continue the 64-bit hash of Fowler, Noll and Vo (FNV-1a) with these bytes. */
static uint64_t hashed(uint64_t hash, const void *bytes, size_t count)
{
    const unsigned char *byte = bytes;
    for (size_t k = 0; k < count; k++) hash = (hash ^ byte[k]) * UINT64_C(0x100000001b3);
    return hash;
}

int replay(void)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325), total = 0;
    uint32_t shortest = UINT32_MAX, longest = 0, which = 0, bad = 0, idle = UINT32_MAX;
    for (int k = 0; k < 16; k++) {
        const uint32_t begin = board_ticks(), spent = (board_ticks() - begin) & 0xFFFFFFu;
        if (spent < idle) idle = spent;
    }
    one_start(&state);
    for (uint32_t k = 0; k < STEPS; k++) {
        const mrd_inputs told = {rows[k][0], rows[k][1], rows[k][2], rows[k][3], rows[k][4]};
        const uint32_t begin = board_ticks();
        const mrd_real current = one_step(&state, &told);
        const uint32_t spent = ((board_ticks() - begin) & 0xFFFFFFu) - idle;
        total += spent;
        if (spent < shortest) shortest = spent;
        if (spent > longest) {
            longest = spent;
            which = k;
        }
        if (!(current >= (mrd_real)0.0 && current <= one_largest())) bad++;
        hash = hashed(hash, &current, sizeof current);
        hash = hashed(hash, &state.flags, sizeof state.flags);
    }
    put_number(shortest, " ");
    put_number(total, " ");
    put_number(longest, " ");
    put_number(which, " ");
    put_number(board_stack(), " ");
    put_number(hash, " ");
    put_number(bad, "\n");
    return 0;
}
