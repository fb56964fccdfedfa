/* The chain: free play, elasticity and dashpot in series with a valve. Every term is off at its default.
 *
 * xb follows x with a play of half width b; e + q - z = xb, y = q', z the cavity. The same force in all:
 *
 *     F = S(e) + cB |e'/v0|^(mB-1) e'                                            compliance, S as in series_valve.c
 *     F = C l/(l + z) - H, H = C (1 - z/L)^-1.3                                   cavity
 *     F = f0 + k0 q + Fg (1 + q/Lg)^-1.3                                         offset, spring, gas
 *       + G Y (1 - phi) (1 + as t) t                                             viscoplastic yield
 *       + (1 + af sgn y) (G (rK Y + K) |y/v0|^m sgn y + cq |y| y)                shear thinning, orifice
 *       + f1 + f2 + f3 + f4 + f5                                                 bristles: pre-yield, friction, memory
 *     G = 1 + b1 q + b2 q^2;  t = (1 - w) tanh u + w C(u), C a straight line to a corner at 1
 *     y = (v1 + mu Y) u + bp (Y u)^1/2                                            creep, and flow through a bypass
 *
 * The cavity (L > 0; without it z = 0): H is what the gas charge, of the length L, bears on the piston with. The chamber
 * that the valve fills as the damper retracts holds free gas, of the length l at that pressure, so that its force never
 * falls to zero: where the valve is too slow z opens, at the force of the charge, and closes before force builds up again.
 * Both are springs in z: C L (1 - z/L)^-0.3 / 0.3 - C l ln(l + z) is stored, hence passive.
 *
 * A bristle is a force: f' = sigma (y - |y| f / level), with a stiffness sigma that neither position nor speed
 * changes, so that f^2 / (2 sigma) is stored and the rest is lost: passive whatever the level does. Levels are
 * phi G Y (1 + as sgn y) in shares 1/2, 1/4, 1/4 (stiffnesses apart by e^0, e^spread, e^-spread), friction
 * (1 + excess exp(-(y/fade)^2)), and memory. When the current moves Y, the share `follow` of a bristle's force goes
 * with it at once; the rest must be built up by travel.
 *
 * A step is backward Euler in y, bristles by the two-term rational form of their exponential; G and the Stribeck level
 * are those before the step, the gas is linear over it, z solves a quadratic. The residual rises with y, its sign at rest tells the side.
 */

#define CHAIN_STEP_RATIO 0.68 /* Longest step relative to that of other laws: backward Euler needs shorter steps. */
#define CHAIN_FLOOR 0.02  /* least G, and least gas volume over its volume at q = 0 */
#define GAS_EXPONENT 1.3
#define CORNER 0.05 /* rounding of C */
#define CHAIN_LEAST 1e-100 /* minimum level of a bristle [N]; below it the rate would overflow */

enum { PRE_YIELD = 3, FRICTION_BRISTLE = 3, MEMORY_BRISTLE = 4, BRISTLES = 5 };

static const double CHAIN_SHARE[PRE_YIELD] = {0.5, 0.25, 0.25}, CHAIN_APART[PRE_YIELD] = {0.0, 1.0, -1.0};

/* State of the chain between steps. */
typedef struct {
    double q, y, y_rate; /* valve travel, velocity and its rate of change */
    double play;         /* displacement behind the play */
    double cavity;       /* travel that the cavity takes, z */
    double bristle[BRISTLES];
    double level[2];     /* yield and memory force that the bristles follow */
} chain_state;

/* Constants of the equation of a step. */
typedef struct {
    const double *c;
    double h, v, e;      /* step, velocity behind the play, elastic travel at y = z = 0 */
    double cavity, per_h; /* z before the step, one over the step or nothing */
    double charge, charge_slope, charge_curvature; /* H, and by z */
    double gain, gain_slope;
    double rest, rest_slope; /* offset, spring and gas at y = 0, and by travel */
    double gas_curvature;
    double viscoplastic, thinning; /* their forces without shape */
    double yield_velocity, bypass; /* speeds at u = 1, of what is in proportion to u and to its root */
    double bristle[BRISTLES];      /* forces before the step */
    double level[2][BRISTLES];     /* retracting, extending */
    double stiffness[BRISTLES];
    double fade;
    int on[BRISTLES];
} chain_step;

/* The equation at one y. */
typedef struct {
    double y, force, slope, force_slope;
    double u, u_slope;          /* and its slope over |y| */
    double t, t_slope, sharper; /* yield's rise, its slope over u, C - tanh */
    double power, log_size, rate; /* thinning power, ln |y/v0|, elastic velocity */
    double e, spring_slope, leak_slope;
    double cavity, length, cavity_slope, by_cavity; /* z, l + z, slopes: of z over y, of its equation over z */
    double bristle[BRISTLES], bristle_slope[BRISTLES], kept[BRISTLES];
} chain_point;

/* Partial derivatives by each coefficient with y and the former states fixed; zero but where a step writes. */
typedef struct {
    double valve[CH_COUNT], compliance[CH_COUNT], bristle[BRISTLES][CH_COUNT];
    double by_travel, bristle_by_travel[BRISTLES], friction_by_speed;
    double charge[CH_COUNT], charge_slope[CH_COUNT]; /* H and its slope */
} chain_partials;

/* Derivatives of the state by every direction. */
typedef struct {
    double q[MRD_DIRECTIONS], y[MRD_DIRECTIONS], play[MRD_DIRECTIONS], cavity[MRD_DIRECTIONS];
    double bristle[BRISTLES][MRD_DIRECTIONS];
    double seed[MRD_DIRECTIONS], before[MRD_DIRECTIONS];
    int coefficient[MRD_DIRECTIONS];
} chain_tangents;

static inline double chain_spring(const double *c, double e, double *slope)
{
    const double u = e - c[CH_GAP], v = e + c[CH_GAP], rr = c[CH_CORNER] * c[CH_CORNER];
    const double su = sqrt(u * u + rr), sv = sqrt(v * v + rr);
    *slope = 0.5 * c[CH_SPRING] * (2.0 + u / su - v / sv);
    return 0.5 * c[CH_SPRING] * (2.0 * e + su - sv);
}

/* Regular at rest: |rate| is not let below a millionth of the reference speed in the slope. */
static inline double chain_leak(const double *c, double rate, double *slope)
{
    const double exponent = c[CH_LEAK_EXPONENT];
    double power = c[CH_LEAK];
    *slope = power;
    if (exponent != 1.0) {
        const double size = fabs(rate) / c[CH_SPEED];
        power *= exp((exponent - 1.0) * log(size > 1e-6 ? size : 1e-6));
        *slope = size > 1e-6 ? exponent * power : power;
    }
    return power * rate;
}

/* Stiffness, level on both sides and former force of one bristle; a level of nothing has no bristle. */
static inline void chain_bristle(chain_step *s, int j, double stiffness, double level, double force)
{
    const double asymmetry = j < PRE_YIELD ? s->c[CH_ASYMMETRY] : 0.0;
    s->on[j] = level > CHAIN_LEAST;
    s->bristle[j] = force;
    s->stiffness[j] = stiffness;
    s->level[0][j] = level * (1.0 - asymmetry);
    s->level[1][j] = level * (1.0 + asymmetry);
}

/* Compute the force of the charge on the piston before the step. */
static void chain_charged(const double *c, double z, chain_step *s)
{
    const double room = 1.0 - z / c[CH_CAVITY_LENGTH], left = room > CHAIN_FLOOR ? room : CHAIN_FLOOR;
    const double per = 1.0 / (c[CH_CAVITY_LENGTH] * left);
    s->per_h = s->h > 0.0 ? 1.0 / s->h : 0.0;
    s->charge = c[CH_CAVITY] * exp(-GAS_EXPONENT * log(left));
    s->charge_slope = GAS_EXPONENT * s->charge * per;
    s->charge_curvature = (GAS_EXPONENT + 1.0) * s->charge_slope * per;
}

/* Set up the step of length h to the displacement x behind the play. */
static void chain_prepare(const double *c, const chain_state *at, double h, double x, double v, chain_step *s)
{
    const double q = at->q, speed = at->y / c[CH_FADE];
    const double gain = 1.0 + q * (c[CH_POSITION] + q * c[CH_CURVATURE]);
    s->c = c;
    s->h = h;
    s->v = v;
    s->e = x - q;
    s->cavity = at->cavity;
    s->per_h = 0.0;
    if (c[CH_CAVITY_LENGTH] > 0.0) chain_charged(c, at->cavity, s);
    s->gain = gain > CHAIN_FLOOR ? gain : CHAIN_FLOOR;
    s->gain_slope = gain > CHAIN_FLOOR ? c[CH_POSITION] + 2.0 * q * c[CH_CURVATURE] : 0.0;
    s->rest = c[C_OFFSET] + c[C_STIFFNESS] * q;
    s->rest_slope = c[C_STIFFNESS];
    s->gas_curvature = 0.0;
    if (c[CH_GAS] != 0.0) {
        const double volume = 1.0 + q / c[CH_GAS_LENGTH], room = volume > CHAIN_FLOOR ? volume : CHAIN_FLOOR;
        const double gas = c[CH_GAS] * exp(-GAS_EXPONENT * log(room)), per = 1.0 / (c[CH_GAS_LENGTH] * room);
        s->rest += gas;
        s->rest_slope -= GAS_EXPONENT * gas * per;
        s->gas_curvature = GAS_EXPONENT * (GAS_EXPONENT + 1.0) * gas * per * per;
    }
    s->viscoplastic = s->gain * c[CH_YIELD] * (1.0 - c[CH_SHARE]);
    s->yield_velocity = c[CH_VELOCITY] + c[CH_CREEP] * c[CH_YIELD];
    s->bypass = c[CH_BYPASS] > 0.0 ? c[CH_BYPASS] * sqrt(c[CH_YIELD]) : 0.0;
    s->thinning = s->gain * (c[CH_THINNING] * c[CH_YIELD] + c[CH_OWN]);
    const double level = s->gain * c[CH_YIELD] * c[CH_SHARE];
    const double apart = c[CH_SPREAD] != 0.0 ? exp(c[CH_SPREAD]) : 1.0;
    const double stiff[PRE_YIELD] = {c[CH_BRISTLE], c[CH_BRISTLE] * apart, c[CH_BRISTLE] / apart};
    for (int j = 0; j < PRE_YIELD; j++)
        chain_bristle(s, j, CHAIN_SHARE[j] * stiff[j], CHAIN_SHARE[j] * level, at->bristle[j]);
    s->fade = c[CH_EXCESS] > 0.0 ? exp(-speed * speed) : 0.0;
    chain_bristle(s, FRICTION_BRISTLE, c[CH_FRICTION_STIFFNESS], c[CH_FRICTION] * (1.0 + c[CH_EXCESS] * s->fade),
                  at->bristle[FRICTION_BRISTLE]);
    chain_bristle(s, MEMORY_BRISTLE, c[CH_MEMORY_STIFFNESS], c[CH_MEMORY], at->bristle[MEMORY_BRISTLE]);
}

/* Compute the bristle after the step at valve velocity y, its slope by y, and the remaining fraction of the old force. */
static inline void chain_bristle_at(const chain_step *s, int j, double y, chain_point *p)
{
    const double side = y < 0.0 ? -1.0 : 1.0, level = s->level[y >= 0.0][j];
    const double rate = s->stiffness[j] * s->h / level, u = rate * fabs(y);
    const double kept = 1.0 / (1.0 + u + 0.5 * u * u), away = s->bristle[j] - side * level;
    p->kept[j] = kept;
    p->bristle[j] = side * level + away * kept;
    p->bristle_slope[j] = -away * (1.0 + u) * kept * kept * rate * side;
}

/* How far the yield force has risen: u of the speed, and its slope. */
static inline void chain_rise(const chain_step *s, double size, chain_point *p)
{
    p->u = size / s->yield_velocity;
    p->u_slope = 1.0 / s->yield_velocity;
    if (s->bypass == 0.0) return;
    const double root = 2.0 * size / (s->bypass + sqrt(s->bypass * s->bypass + 4.0 * s->yield_velocity * size));
    p->u = root * root;
    p->u_slope = 2.0 * root / (2.0 * s->yield_velocity * root + s->bypass);
}

/* Rise of the yield force with u. */
static inline void chain_yield(double knee, double u, double side, chain_point *p)
{
    const double decay = exp(-2.0 * u), t = (1.0 - decay) / (1.0 + decay);
    p->t = side * t;
    p->t_slope = 1.0 - t * t;
    p->sharper = 0.0;
    if (knee == 0.0) return;
    const double above = sqrt((u + 1.0) * (u + 1.0) + CORNER * CORNER), below = sqrt((u - 1.0) * (u - 1.0) + CORNER * CORNER);
    p->sharper = side * (0.5 * (above - below) - t);
    p->t += knee * p->sharper;
    p->t_slope += knee * (0.5 * ((u + 1.0) / above - (u - 1.0) / below) - p->t_slope);
}

/* Open or close the cavity at the valve's force: F + H + H' (z - before) = C l / (l + z) is a quadratic in l + z. */
static inline void chain_cavity(const chain_step *s, chain_point *p)
{
    const double bubble = s->c[CH_BUBBLE], gas = s->c[CH_CAVITY] * bubble, slope = s->charge_slope;
    const double a = p->force + s->charge - slope * (s->cavity + bubble);
    p->by_cavity = sqrt(a * a + 4.0 * slope * gas);
    p->length = a > 0.0 ? 2.0 * gas / (p->by_cavity + a) : 0.5 * (p->by_cavity - a) / slope;
    p->cavity = p->length - bubble;
    p->cavity_slope = -p->length / p->by_cavity * p->force_slope;
}

/* Valve less compliance at y; rises with y. */
static double chain_residual(const chain_step *s, double y, chain_point *p)
{
    const double *c = s->c, size = fabs(y), side = y < 0.0 ? -1.0 : 1.0, as = c[CH_ASYMMETRY];
    const double flow = 1.0 + c[CH_FLOW_ASYMMETRY] * side;
    double force = s->rest + s->rest_slope * s->h * y, slope = s->rest_slope * s->h;
    p->y = y;
    p->u = p->u_slope = p->t = p->t_slope = p->sharper = p->power = 0.0;
    p->log_size = size > 0.0 ? log(size / c[CH_SPEED]) : 0.0;
    if (s->viscoplastic > 0.0) {
        chain_rise(s, size, p);
        chain_yield(c[CH_KNEE], p->u, side, p);
        force += s->viscoplastic * (1.0 + as * p->t) * p->t;
        slope += s->viscoplastic * (1.0 + 2.0 * as * p->t) * p->t_slope * p->u_slope;
    }
    if (s->thinning > 0.0 && size > 0.0) {
        p->power = side * flow * exp(c[CH_EXPONENT] * p->log_size);
        force += s->thinning * p->power;
        slope += s->thinning * c[CH_EXPONENT] * p->power / y;
    }
    force += c[CH_ORIFICE] * flow * size * y;
    slope += 2.0 * c[CH_ORIFICE] * flow * size;
    for (int j = 0; j < BRISTLES; j++) {
        if (!s->on[j]) continue;
        chain_bristle_at(s, j, y, p);
        force += p->bristle[j];
        slope += p->bristle_slope[j];
    }
    p->force = force;
    p->force_slope = slope;
    p->cavity = s->cavity;
    p->cavity_slope = 0.0;
    if (s->per_h > 0.0) chain_cavity(s, p);
    p->e = s->e - s->h * y + p->cavity;
    p->rate = s->v - y + s->per_h * (p->cavity - s->cavity);
    const double spring = chain_spring(c, p->e, &p->spring_slope), leak = chain_leak(c, p->rate, &p->leak_slope);
    p->slope = slope + p->spring_slope * (s->h - p->cavity_slope)
             + p->leak_slope * (1.0 - s->per_h * p->cavity_slope);
    return force - spring - leak;
}

/* Take a last Newton step without a new evaluation: its error is the square of the one before. */
static void chain_finish(const chain_step *s, double dy, chain_point *p)
{
    p->y += dy;
    p->force += p->force_slope * dy;
    p->cavity += p->cavity_slope * dy;
    p->e -= (s->h - p->cavity_slope) * dy;
    p->rate -= (1.0 - s->per_h * p->cavity_slope) * dy;
    for (int j = 0; j < BRISTLES; j++)
        if (s->on[j]) p->bristle[j] += p->bristle_slope[j] * dy;
}

/* Solve the step by Newton's method in a bracket of |y|; the residual at rest gives the sign. */
static void chain_solve(const chain_step *s, double guess, chain_point *p)
{
    const double at_rest = chain_residual(s, 0.0, p), small = 0.01 * s->yield_velocity;
    if (at_rest == 0.0) return;
    const double sign = at_rest < 0.0 ? 1.0 : -1.0;
    double low = 0.0, high = HUGE_VAL, size = sign * guess > 0.0 ? fabs(guess) : small;
    for (int i = 0; i < 100; i++) {
        const double residual = sign * chain_residual(s, sign * size, p);
        const double next = size - residual / p->slope;
        if (residual > 0.0) high = size;
        else low = size;
        const int inside = next >= low && next <= high; /* on the side where rounding ends a step of no length */
        if (inside && fabs(residual) <= 1e-7 * (s->viscoplastic + fabs(p->force) + fabs(s->rest))) {
            chain_finish(s, sign * (next - size), p);
            return;
        }
        double moved = next;
        if (!(next > low)) moved = low > 0.0 ? 0.5 * (low + size) : 0.05 * size;
        if (!(next < high)) moved = high == HUGE_VAL ? 4.0 * size : 0.5 * (low + high);
        if (search_halves(i, high)) moved = 0.5 * (low + high);
        if (moved == size) return;
        size = moved;
    }
}

/* Partial derivatives of one bristle by what its level and its stiffness depend on. */
static void chain_bristle_partials(const chain_step *s, const chain_point *p, int j, chain_partials *d)
{
    const double *c = s->c, side = p->y < 0.0 ? -1.0 : 1.0, level = s->level[p->y >= 0.0][j];
    const double u = s->stiffness[j] * s->h * fabs(p->y) / level, kept = p->kept[j];
    const double fall = -(s->bristle[j] - side * level) * (1.0 + u) * kept * kept * u;
    const double by_level = side * (1.0 - kept) - fall / level, by_stiffness = fall / s->stiffness[j];
    double *by = d->bristle[j];
    d->bristle_by_travel[j] = 0.0;
    if (j == MEMORY_BRISTLE) {
        by[CH_MEMORY] = by_level;
        by[CH_MEMORY_STIFFNESS] = by_stiffness;
    } else if (j == FRICTION_BRISTLE) {
        const double steep = c[CH_FRICTION] * c[CH_EXCESS] * s->fade;
        by[CH_FRICTION] = by_level * level / c[CH_FRICTION];
        by[CH_EXCESS] = by_level * c[CH_FRICTION] * s->fade;
        by[CH_FRICTION_STIFFNESS] = by_stiffness;
        d->friction_by_speed = by_level * steep;
    } else {
        const double per = by_level * level / s->gain;
        by[CH_YIELD] = by_level * level / c[CH_YIELD];
        by[CH_SHARE] = by_level * level / c[CH_SHARE];
        by[CH_ASYMMETRY] = by_level * CHAIN_SHARE[j] * s->gain * c[CH_YIELD] * c[CH_SHARE] * side;
        by[CH_BRISTLE] = by_stiffness * s->stiffness[j] / c[CH_BRISTLE];
        by[CH_SPREAD] = by_stiffness * s->stiffness[j] * CHAIN_APART[j];
        d->bristle_by_travel[j] = per * s->gain_slope;
        by[CH_POSITION] = by[CH_CURVATURE] = per; /* times q and q^2 below */
    }
}

/* Partial derivatives at the solution; `q` and `y` are those before the step. */
static void chain_partials_at(const chain_step *s, const chain_point *p, double q, double y, chain_partials *d)
{
    const double *c = s->c, yielded = (1.0 + c[CH_ASYMMETRY] * p->t) * p->t, ahead = s->h * p->y;
    const double shaped = s->viscoplastic * yielded + s->thinning * p->power;
    const double moving = s->gain_slope != 0.0 || s->gain > CHAIN_FLOOR;
    const double flow = 1.0 + (p->y < 0.0 ? -c[CH_FLOW_ASYMMETRY] : c[CH_FLOW_ASYMMETRY]);
    double *by = d->valve, *compliance = d->compliance;
    d->by_travel = s->rest_slope + s->gas_curvature * ahead + shaped / s->gain * s->gain_slope;
    d->friction_by_speed = 0.0;
    by[C_OFFSET] = 1.0;
    by[C_STIFFNESS] = q + ahead;
    by[CH_SHARE] = -s->gain * c[CH_YIELD] * yielded;
    by[CH_THINNING] = s->gain * c[CH_YIELD] * p->power;
    by[CH_OWN] = s->gain * p->power;
    by[CH_EXPONENT] = s->thinning * p->power * p->log_size;
    by[CH_ORIFICE] = flow * fabs(p->y) * p->y;
    by[CH_FLOW_ASYMMETRY] = s->thinning * fabs(p->power) / flow + c[CH_ORIFICE] * p->y * p->y;
    by[CH_ASYMMETRY] = s->viscoplastic * p->t * p->t;
    const double by_rise = s->viscoplastic * (1.0 + 2.0 * c[CH_ASYMMETRY] * p->t);
    by[CH_KNEE] = by_rise * p->sharper;
    by[CH_VELOCITY] = p->y < 0.0 ? by_rise * p->t_slope * p->u_slope * p->u : -by_rise * p->t_slope * p->u_slope * p->u;
    const double by_bypass = p->u > 0.0 ? by[CH_VELOCITY] / sqrt(p->u) : 0.0;
    by[CH_BYPASS] = by_bypass * sqrt(c[CH_YIELD]);
    by[CH_CREEP] = by[CH_VELOCITY] * c[CH_YIELD];
    by[CH_YIELD] = s->gain * ((1.0 - c[CH_SHARE]) * yielded + c[CH_THINNING] * p->power) + by[CH_VELOCITY] * c[CH_CREEP];
    if (s->bypass > 0.0) by[CH_YIELD] += by_bypass * 0.5 * s->bypass / c[CH_YIELD];
    by[CH_POSITION] = moving * shaped / s->gain * q;
    by[CH_CURVATURE] = moving * shaped / s->gain * q * q;
    if (c[CH_GAS] != 0.0) {
        const double length = c[CH_GAS_LENGTH], volume = 1.0 + q / length, room = volume > CHAIN_FLOOR ? volume : CHAIN_FLOOR;
        const double unit = exp(-GAS_EXPONENT * log(room)), per = GAS_EXPONENT / (length * room);
        by[CH_GAS] = unit * (1.0 - per * ahead);
        by[CH_GAS_LENGTH] = c[CH_GAS] * unit * per / length
                             * (q + ahead * (1.0 - (GAS_EXPONENT + 1.0) * q / (length * room)));
    }
    if (s->per_h > 0.0) {
        const double length = c[CH_CAVITY_LENGTH], z = s->cavity;
        d->charge[CH_CAVITY] = s->charge / c[CH_CAVITY];
        d->charge_slope[CH_CAVITY] = s->charge_slope / c[CH_CAVITY];
        d->charge[CH_CAVITY_LENGTH] = -s->charge_slope * z / length;
        d->charge_slope[CH_CAVITY_LENGTH] = -(s->charge_slope + s->charge_curvature * z) / length;
    }
    for (int j = 0; j < BRISTLES; j++) {
        if (!s->on[j]) continue;
        chain_bristle_partials(s, p, j, d);
        if (j >= PRE_YIELD) continue;
        d->bristle[j][CH_POSITION] *= moving * q;
        d->bristle[j][CH_CURVATURE] *= moving * q * q;
    }
    d->bristle[FRICTION_BRISTLE][CH_FADE] = 0.0;
    if (d->friction_by_speed != 0.0) {
        const double ratio = y / c[CH_FADE];
        d->bristle[FRICTION_BRISTLE][CH_FADE] = d->friction_by_speed * 2.0 * ratio * ratio / c[CH_FADE];
        d->friction_by_speed *= -2.0 * ratio / c[CH_FADE];
    }
    const double u = p->e - c[CH_GAP], v = p->e + c[CH_GAP], rr = c[CH_CORNER] * c[CH_CORNER];
    const double su = 1.0 / sqrt(u * u + rr), sv = 1.0 / sqrt(v * v + rr), size = fabs(p->rate) / c[CH_SPEED];
    compliance[CH_SPRING] = 0.5 * (2.0 * p->e + 1.0 / su - 1.0 / sv);
    compliance[CH_GAP] = -0.5 * c[CH_SPRING] * (u * su + v * sv);
    compliance[CH_CORNER] = 0.5 * c[CH_SPRING] * c[CH_CORNER] * (su - sv);
    const double of = log(size > 1e-6 ? size : 1e-6);
    compliance[CH_LEAK] = p->rate * (c[CH_LEAK_EXPONENT] != 1.0 ? exp((c[CH_LEAK_EXPONENT] - 1.0) * of) : 1.0);
    compliance[CH_LEAK_EXPONENT] = c[CH_LEAK] * compliance[CH_LEAK] * of;
    by[CH_SPEED] = -s->thinning * p->power * c[CH_EXPONENT] / c[CH_SPEED];
    compliance[CH_SPEED] = -(c[CH_LEAK_EXPONENT] - 1.0) * c[CH_LEAK] * compliance[CH_LEAK] / c[CH_SPEED];
}

/* How z moves along a direction at fixed y, where the force moves by `force` and z moved by `before`. */
static double chain_cavity_moved(const chain_step *s, const chain_point *p, const chain_partials *d, int k, double seed,
                                 double before, double force)
{
    const double bubble = k == CH_BUBBLE ? seed : 0.0, limit = k == CH_CAVITY ? seed : 0.0;
    const double slope = d->charge_slope[k] * seed + s->charge_curvature * before;
    const double gas = s->c[CH_BUBBLE] * limit + s->c[CH_CAVITY] * bubble;
    const double sum = force + d->charge[k] * seed - s->charge_slope * bubble + slope * (p->cavity - s->cavity);
    return (gas - p->length * sum) / p->by_cavity - bubble;
}

/* Update the derivatives of the state after a solved step. `column` receives those of the force unless it is NULL. */
static void chain_differentiate(const chain_step *s, const chain_point *p, const chain_partials *d, size_t ways,
                                chain_tangents *t, double *const *column, size_t i)
{
    for (size_t w = 0; w < ways; w++) {
        const int k = t->coefficient[w];
        const double seed = t->seed[w], q = t->q[w];
        double force = d->valve[k] * seed + d->by_travel * q;
        double bristle[BRISTLES];
        for (int j = 0; j < BRISTLES; j++) {
            if (!s->on[j]) continue;
            bristle[j] = d->bristle[j][k] * seed + p->kept[j] * t->bristle[j][w] + d->bristle_by_travel[j] * q;
            if (j == FRICTION_BRISTLE) bristle[j] += d->friction_by_speed * t->y[w];
            force += bristle[j];
        }
        double cavity = t->cavity[w];
        if (s->per_h > 0.0) cavity = chain_cavity_moved(s, p, d, k, seed, t->cavity[w], force);
        const double residual = force - d->compliance[k] * seed - p->spring_slope * (t->play[w] - q + cavity)
                              - p->leak_slope * s->per_h * (cavity - t->cavity[w]);
        const double y = -residual / p->slope;
        for (int j = 0; j < BRISTLES; j++)
            if (s->on[j]) t->bristle[j][w] = bristle[j] + p->bristle_slope[j] * y;
        t->q[w] = q + s->h * y;
        t->cavity[w] = cavity + p->cavity_slope * y;
        t->y[w] = y;
        if (column) column[w][i] = force + p->force_slope * y;
    }
}

/* Let the bristles' forces follow a level that the current has moved, as far as they follow at once. */
static void chain_follow(const double *c, chain_state *at, size_t ways, chain_tangents *t)
{
    const int of[2] = {CH_YIELD, CH_MEMORY}, from[2] = {0, MEMORY_BRISTLE}, to[2] = {PRE_YIELD, BRISTLES};
    for (int k = 0; k < 2; k++) {
        const double now = c[of[k]], before = at->level[k], ratio = now / before;
        at->level[k] = now;
        if (!(before > 0.0) || now == before) continue;
        const double factor = 1.0 + c[CH_FOLLOW] * (ratio - 1.0);
        for (int j = from[k]; j < to[k]; j++) {
            for (size_t w = 0; w < ways; w++) {
                double by = factor * t->bristle[j][w];
                if (t->coefficient[w] == CH_FOLLOW) by += at->bristle[j] * (ratio - 1.0) * t->seed[w];
                if (t->coefficient[w] == of[k])
                    by += at->bristle[j] * c[CH_FOLLOW] * (t->seed[w] - ratio * t->before[w]) / before;
                t->bristle[j][w] = by;
            }
            at->bristle[j] *= factor;
        }
    }
}

/* Move the place behind the play to the displacement x; return whether it moves along. */
static int chain_play(const double *c, double x, chain_state *at, size_t ways, chain_tangents *t)
{
    const double half = c[CH_PLAY], ahead = x - at->play;
    if (fabs(ahead) < half) return 0;
    const double side = ahead < 0.0 ? -1.0 : 1.0;
    at->play = x - side * half;
    for (size_t w = 0; w < ways; w++) t->play[w] = t->coefficient[w] == CH_PLAY ? -side * t->seed[w] : 0.0;
    return 1;
}

/* Step by h to (x, v). h = 0 computes the force of the present state. */
static double chain_advance(const double *c, double h, double x, double v, chain_state *at, size_t ways, chain_tangents *t,
                            chain_partials *d, double *const *column, size_t i)
{
    chain_step s;
    chain_point p;
    const int along = chain_play(c, x, at, ways, t);
    chain_prepare(c, at, h, at->play, along ? v : 0.0, &s);
    chain_solve(&s, h > 0.0 ? at->y + h * at->y_rate : v, &p);
    if (ways) {
        chain_partials_at(&s, &p, at->q, at->y, d);
        chain_differentiate(&s, &p, d, ways, t, column, i);
    }
    for (int j = 0; j < BRISTLES; j++)
        if (s.on[j]) at->bristle[j] = p.bristle[j];
    at->y_rate = h > 0.0 ? (p.y - at->y) / h : 0.0;
    at->y = p.y;
    at->q += h * p.y;
    at->cavity = p.cavity;
    return p.force;
}

/* Interpolate the coefficients between the samples i - 1 and i; terms of other laws are not used. */
static const double *chain_coefficients(const mrd_model *m, size_t i, double share, double *store)
{
    if (!m->stride) return m->coefficient;
    for (int k = 0; k < CH_COUNT; k++) {
        const double *row = m->coefficient + (size_t)k * m->stride + i;
        store[k] = i ? row[-1] + share * (row[0] - row[-1]) : row[0];
    }
    return store;
}

static void chain_seeds(const mrd_direction *const *way, size_t ways, size_t i, double share, chain_tangents *t)
{
    for (size_t w = 0; w < ways; w++) {
        t->before[w] = t->seed[w];
        if (!way[w]->seed) continue;
        const double *row = way[w]->seed + way[w]->stride * i, now = row[0];
        const double last = i ? *(row - way[w]->stride) : now;
        t->seed[w] = last + share * (now - last);
    }
}

static size_t chain_substeps(const mrd_record *r)
{
    const size_t least = (size_t)ceil(r->step / (CHAIN_STEP_RATIO * r->longest_step) - 1e-9);
    return r->substeps > least ? r->substeps : least;
}

static chain_state chain_opened(const mrd_record *r, const mrd_state *state)
{
    chain_state at;
    memset(&at, 0, sizeof at);
    at.q = at.play = r->n ? r->x[0] : 0.0;
    if (!r->behind) return at;
    at.q = state->y;
    at.y = state->q;
    at.y_rate = state->q_rate;
    at.play = state->play;
    at.cavity = state->cavity;
    memcpy(at.bristle, state->bristle, sizeof at.bristle);
    memcpy(at.level, state->level, sizeof at.level);
    return at;
}

/* Force of the chain along a record, and its derivatives by `ways` directions of its coefficients. */
static void chain_run(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way, double *force,
                      double *const *column, mrd_state *state)
{
    double store[CH_COUNT];
    chain_state at = chain_opened(r, state);
    chain_tangents t;
    chain_partials d;
    memset(&d, 0, sizeof d);
    memset(&t, 0, sizeof t);
    for (size_t w = 0; w < ways; w++) {
        t.coefficient[w] = way[w]->coefficient;
        t.seed[w] = 1.0;
    }
    const size_t substeps = chain_substeps(r);
    const double h = r->step / (double)substeps;
    if (r->n && !r->behind) {
        const double *c = chain_coefficients(m, 0, 1.0, store);
        chain_seeds(way, ways, 0, 1.0, &t);
        at.level[0] = c[CH_YIELD];
        at.level[1] = c[CH_MEMORY];
        force[0] = chain_advance(c, 0.0, r->x[0], r->v[0], &at, ways, &t, &d, column, 0);
    }
    for (size_t i = 1; i < r->n; i++) {
        const interval between = interval_before(r, i);
        for (size_t j = 1; j <= substeps; j++) {
            const double share = (double)j / (double)substeps;
            double x, v;
            interval_at(&between, share, &x, &v);
            const double *c = chain_coefficients(m, i, share, store);
            if (m->stride) {
                chain_seeds(way, ways, i, share, &t);
                chain_follow(c, &at, ways, &t);
            }
            force[i] = chain_advance(c, h, x, v, &at, ways, &t, &d, j == substeps ? column : NULL, i);
        }
    }
    if (!state) return;
    state->y = at.q;
    state->q = at.y;
    state->q_rate = at.y_rate;
    state->play = at.play;
    state->cavity = at.cavity;
    memcpy(state->bristle, at.bristle, sizeof at.bristle);
    memcpy(state->level, at.level, sizeof at.level);
}
