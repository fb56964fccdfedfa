/* Dynamics between a command and the field: a first-order lag with separate rise and fall times.
 *
 * The time constant is `rise` while the absolute input exceeds the output, otherwise `fall`. If a driver cannot force
 * the current down, the output falls no faster than with the free-wheeling time constant `wheel` (0: no free-wheeling).
 * With `saturation` I_s (0: no saturation), the lag acts on the flux phi = I / (1 + I / I_s), so that a saturated
 * current falls faster: wheel phi' = -I.
 */

/* Return the flux of a free-wheeling current after one step, by a method of order two. *slope is the derivative of this
 * flux with respect to the initial flux. */
static double flux_left(double flux, double step, double wheel, double saturation, double *slope)
{
    const double bend = saturation > 0.0 ? 1.0 / saturation : 0.0, share = step / wheel, rate = 1.0 / (1.0 - bend * flux);
    const double half = 1.0 + 0.5 * share * rate, mid = flux / half, opened = 1.0 / (1.0 - bend * mid);
    const double left = exp(-share * opened);
    const double mid_slope = (1.0 - 0.5 * mid * share * bend * rate * rate) / half;
    *slope = left * (1.0 - flux * share * bend * opened * opened * mid_slope);
    return flux * left;
}

/* Compute the response to a command that is linear between samples, and its derivative with respect to the active time
 * constant. The derivative is exact if rise and fall are equal. `before` has the output and its derivative at sample 0;
 * NULL: the steady state. */
static void first_order_lag(size_t n, double step, double rise, double fall, double wheel, double saturation,
                            const double *command, double *applied, double *by_lag, const double *before)
{
    if (!n) return;
    applied[0] = before ? before[0] : command[0];
    by_lag[0] = before ? before[1] : 0.0;
    const double lags[2] = {fall, rise};
    double decays[2];
    for (int k = 0; k < 2; k++) decays[k] = lags[k] > 0.0 ? exp(-step / lags[k]) : 0.0;
    for (size_t i = 1; i < n; i++) {
        const int rising = fabs(command[i]) > fabs(applied[i - 1]);
        const double lag = lags[rising], decay = decays[rising];
        const double slope = (command[i] - command[i - 1]) / step;
        if (lag > 0.0) {
            /* This is the exact response to a ramp c = c0 + s t: c - s lag + (a0 - c0 + s lag) decay. */
            const double gap = applied[i - 1] - command[i - 1] + slope * lag;
            applied[i] = command[i] - slope * lag + gap * decay;
            by_lag[i] = -slope + (by_lag[i - 1] + slope) * decay + gap * decay * step / (lag * lag);
        } else {
            applied[i] = command[i];
            by_lag[i] = -slope;
        }
        if (rising || !(wheel > 0.0)) continue;
        double kept;
        const double wheeled = flux_left(fabs(applied[i - 1]), step, wheel, saturation, &kept);
        if (fabs(applied[i]) < wheeled) {
            applied[i] = copysign(wheeled, applied[i - 1]);
            by_lag[i] = kept * by_lag[i - 1];
        }
    }
}
