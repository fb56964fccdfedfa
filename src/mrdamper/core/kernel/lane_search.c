/* Find the root of an increasing function in each lane by Newton's method in a bracket, for p = |root| with fixed sign.
 *
 * The sign is the sign of the start value. If Newton's method leaves this side, the value at zero decides. A finished
 * lane is evaluated again at its root with bitwise equal results.
 */

/* After this number of steps, every second step is a bisection. Newton's method oscillates about a root with infinite
 * slope, for example the root of a dashpot with exponent 1/2 at rest. */
#define SEARCH_PATIENCE 16
#define SEARCH_STEPS_MAX 100
#define SEARCH_TOLERANCE 1e-7 /* If residual / force is smaller, one more Newton step ends the search. */

typedef struct {
    pack sign, p; /* next argument of the function: sign * p */
    pack low, high, small;
    pack last; /* final Newton step with sign, which the caller takes without a new evaluation */
    pack_mask known, done;
    int step;
} lane_search;

IN_LANES void search_begin(pack guess, pack small, lane_search *f)
{
    const pack zero = pack_of(0.0), size = size_of(guess);
    f->sign = choose(is_less(guess, zero), pack_of(-1.0), pack_of(1.0));
    f->p = choose(is_positive(size), size, small);
    f->low = f->last = zero;
    f->high = pack_of(HUGE_VAL);
    f->small = small;
    f->step = 0;
    f->known = f->done = is_less(zero, zero);
}

/* Narrow the bracket with the value and slope at the argument sign * p. A value below `near` needs only one more Newton
 * step. Return 0 if all lanes are finished. `ask` marks the lanes for which search_turn() needs the value at rest. */
IN_LANES int search_on(lane_search *f, pack value, pack slope, pack near, pack_mask *ask)
{
    const pack never = pack_of(HUGE_VAL), p = f->p, residual = f->sign * value, next = p - residual / slope;
    const pack_mask above = is_positive(residual);
    f->high = choose(above, p, f->high);
    f->low = choose(above, f->low, p);
    const pack_mask over_low = is_less(f->low, next), under_high = is_less(next, f->high);
    /* A step that ends on the bracket because of rounding has converged. Bisection would only improve the last
     * digits. */
    const pack_mask within = both(both(is_at_most(f->low, next), is_at_most(next, f->high)), is_less(next, never));
    const pack_mask converged = both(both(is_at_most(size_of(residual), near), within), not_of(f->done));
    f->last = choose(converged, f->sign * (next - p), f->last);
    f->done = either(f->done, converged);
    *ask = is_less(p, p);
    if (all_of(f->done)) return 0;
    pack moved = next;
    const int step = f->step++, late = step > SEARCH_PATIENCE && step % 2;
    if (late || !all_of(either(both(over_low, under_high), f->done))) { /* rare */
        const pack_mask from_rest = is_equal(f->low, pack_of(0.0));
        *ask = both(both(from_rest, not_of(over_low)), not_of(either(f->known, f->done)));
        moved = choose(over_low, next, choose(from_rest, 0.05 * p, 0.5 * (f->low + p)));
        moved = choose(under_high, moved, choose(is_equal(f->high, never), 4.0 * p, 0.5 * (f->low + f->high)));
        if (late) moved = choose(both(is_less(f->high, never), not_of(*ask)), 0.5 * (f->low + f->high), moved);
    }
    f->p = choose(f->done, p, moved);
    f->done = either(f->done, both(is_equal(moved, p), not_of(*ask)));
    return 1;
}

/* In the lanes of `ask`, reverse the sign if the root is on the other side of zero, and finish if the root is zero. */
static void search_turn(lane_search *f, pack_mask ask, pack at_rest)
{
    const pack zero = pack_of(0.0), residual = f->sign * at_rest;
    const pack_mask turns = both(ask, is_positive(residual)), rests = both(ask, is_equal(residual, zero));
    f->known = either(f->known, ask);
    f->sign = choose(turns, -f->sign, f->sign);
    f->high = choose(turns, pack_of(HUGE_VAL), f->high);
    f->p = choose(turns, f->small, choose(rests, zero, f->p));
    f->done = either(f->done, rests);
}
