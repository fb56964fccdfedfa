/* Roots of functions that rise, one in each lane: Newton steps kept inside a bracket, in p = |root| on one side of rest.
 *
 * The side is that of the guess. If Newton's method leaves it, the value at rest decides. A finished lane is
  * evaluated again at its root with the same bits.
 */

typedef struct {
    pack sign, p; /* next argument of the function: sign * p */
    pack low, high, small;
    pack last; /* a Newton step that is to be taken without a new evaluation, with its sign */
    pack_mask known, done;
    int step;
} lane_search;

static void search_begin(pack guess, pack small, lane_search *f)
{
    const pack zero = pack_of(0.0), size = size_of(guess);
    f->sign = choose((pack_mask)(guess < 0.0), pack_of(-1.0), pack_of(1.0));
    f->p = choose((pack_mask)(size > 0.0), size, small);
    f->low = f->last = zero;
    f->high = pack_of(HUGE_VAL);
    f->small = small;
    f->step = 0;
    f->known = f->done = (pack_mask)zero;
}

/* Bring the bracket on by the value and slope at sign p; `near` is how small a value is small enough for one more Newton step.
 * Return 0 if all lanes are finished. `ask` marks lanes that need the value at rest by search_turn(). */
IN_LANES int search_on(lane_search *f, pack value, pack slope, pack near, pack_mask *ask)
{
    const pack never = pack_of(HUGE_VAL), p = f->p, residual = f->sign * value, next = p - residual / slope;
    const pack_mask above = (pack_mask)(residual > 0.0);
    f->high = choose(above, p, f->high);
    f->low = choose(above, f->low, p);
    const pack_mask over_low = (pack_mask)(next > f->low), under_high = (pack_mask)(next < f->high);
    /* A step that rounding ends on the bracket's own side is one of no length: halving would go on for the last digits. */
    const pack_mask within = (pack_mask)(next >= f->low) & (pack_mask)(next <= f->high);
    const pack_mask converged = (pack_mask)(size_of(residual) <= near) & within & ~f->done;
    f->last = choose(converged, f->sign * (next - p), f->last);
    f->done |= converged;
    *ask = f->known ^ f->known;
    if (!any_of(~f->done)) return 0;
    pack moved = next;
    const int late = search_halves(f->step++, 0.0);
    if (late || any_of(~(over_low & under_high) & ~f->done)) { /* rarely */
        const pack_mask from_rest = (pack_mask)(f->low == 0.0);
        *ask = ~over_low & from_rest & ~f->known & ~f->done;
        moved = choose(over_low, next, choose(from_rest, 0.05 * p, 0.5 * (f->low + p)));
        moved = choose(under_high, moved, choose((pack_mask)(f->high == never), 4.0 * p, 0.5 * (f->low + f->high)));
        if (late) moved = choose((pack_mask)(f->high < never) & ~*ask, 0.5 * (f->low + f->high), moved);
    }
    f->p = choose(f->done, p, moved);
    f->done |= (pack_mask)(moved == p) & ~*ask;
    return 1;
}

/* Turn lanes that ask round where their root is on the other side of rest; end those whose root is there. */
static void search_turn(lane_search *f, pack_mask ask, pack at_rest)
{
    const pack residual = f->sign * at_rest;
    const pack_mask turns = ask & (pack_mask)(residual > 0.0), rests = ask & (pack_mask)(residual == 0.0);
    f->known |= ask;
    f->sign = choose(turns, -f->sign, f->sign);
    f->high = choose(turns, pack_of(HUGE_VAL), f->high);
    f->p = choose(turns, f->small, choose(rests, pack_of(0.0), f->p));
    f->done |= rests;
}
