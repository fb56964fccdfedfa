/* The compliance of the implicit laws: free play in series with a spring, and a dashpot in parallel with both. The
 * force at the elastic travel e is
 *
 *     S(e) + cB |e'/v0|^(mB-1) e',   S(e) = k/2 [2 e + sqrt((e-d)^2 + r^2) - sqrt((e+d)^2 + r^2)]
 */

#define LEAK_SPEED_RATIO_MIN 1e-6 /* At smaller speeds / v0, a straight line replaces the power of the dashpot. */

typedef struct {
    pack spring, gap, corner, leak, exponent, per_speed;
    int bent; /* 1 if the exponent of at least one lane is not 1 */
} compliance;

typedef struct {
    pack e, rate, spring_slope, leak_slope;
} compliance_point;

/* Return the compliance. `c` are its coefficients, the spring first. */
IN_LANES compliance compliance_of(const pack *c, pack per_speed)
{
    const compliance out = {c[0], c[1], c[2], c[3], c[4], per_speed, some_lane(c[4] - 1.0)};
    return out;
}

/* Return true in lanes in which the force of the dashpot is a power of the rate, not a straight line. */
IN_LANES pack_mask is_bent(const compliance *c, pack rate)
{
    return is_less(pack_of(LEAK_SPEED_RATIO_MIN), size_of(rate) * c->per_speed);
}

/* Return the force of the dashpot divided by leak and rate. *log_speed receives the logarithm of the speed. */
IN_LANES pack leak_power(const compliance *c, pack rate, pack *log_speed)
{
    *log_speed = log_of(greater_of(size_of(rate) * c->per_speed, pack_of(LEAK_SPEED_RATIO_MIN)));
    return c->bent ? exp_of((c->exponent - 1.0) * *log_speed) : pack_of(1.0);
}

/* Return the force at the travel and rate of a point, and store its slopes in the point. */
IN_LANES pack compliance_force(const compliance *c, compliance_point *p)
{
    const pack u = p->e - c->gap, v = p->e + c->gap, rr = c->corner * c->corner;
    const pack su = root_of(u * u + rr), sv = root_of(v * v + rr);
    p->spring_slope = 0.5 * c->spring * (2.0 + (u * sv - v * su) / (su * sv));
    pack power = p->leak_slope = c->leak;
    if (c->bent) {
        pack log_speed;
        power = c->leak * leak_power(c, p->rate, &log_speed);
        p->leak_slope = choose(is_bent(c, p->rate), c->exponent * power, power);
    }
    return 0.5 * c->spring * (2.0 * p->e + su - sv) + power * p->rate;
}

/* Compute the derivatives of the force with respect to spring, gap, corner, leak and exponent, in this order. */
IN_LANES void compliance_partials(const compliance *c, const compliance_point *p, pack *by)
{
    const pack u = p->e - c->gap, v = p->e + c->gap, rr = c->corner * c->corner;
    const pack su = root_of(u * u + rr), sv = root_of(v * v + rr), per_u = 1.0 / su, per_v = 1.0 / sv;
    pack log_speed;
    by[0] = 0.5 * (2.0 * p->e + su - sv);
    by[1] = -0.5 * c->spring * (u * per_u + v * per_v);
    by[2] = 0.5 * c->spring * c->corner * (per_u - per_v);
    by[3] = p->rate * leak_power(c, p->rate, &log_speed);
    by[4] = c->leak * by[3] * log_speed;
}
