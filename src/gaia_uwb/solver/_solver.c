/* The solver's inner loop: locate many anchors, each from its own ranges along a known path.
 *
 * multilateration.py holds the interface, the settings and the mathematics in words; this file
 * holds the part that must be fast. Every problem (one anchor of one episode) is solved on its own
 * from a private copy of its usable ranges, so a problem never sees another one's numbers.
 *
 * One problem, in order:
 *   1. gather      usable ranges into contiguous columns
 *   2. start       global minimum of the squared-range cost (a secular equation), twice: with the
 *                  given weights, then with robust ones
 *   3. refine      from the start, then from the mirror image of what that gave: Student-t maximum
 *                  likelihood of place, range bias and scale, by damped Fisher scoring
 *   4. summarise   likelihood, information matrix, long-run variance of the score
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* One source, the widest vector unit that the machine has at run time. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define FAST __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FAST
#endif

/* The columns of a problem never overlap; without the word the compiler must assume they may. */
#if defined(__clang__)
#define INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define INDEPENDENT _Pragma("GCC ivdep")
#else
#define INDEPENDENT
#endif

/* Columns of the result, one row per problem and hypothesis; named in multilateration.py too. */
enum {
    OUT_EAST, OUT_NORTH, OUT_BIAS, OUT_SCALE, OUT_NLL,
    OUT_INFO_EE, OUT_INFO_EN, OUT_INFO_NN, OUT_INFO_EB, OUT_INFO_NB, OUT_INFO_BB,
    OUT_MEAT_EE, OUT_MEAT_EN, OUT_MEAT_NN, OUT_MEAT_EB, OUT_MEAT_NB, OUT_MEAT_BB,
    OUT_CORRELATION, OUT_ITERATIONS, OUT_CONVERGED, OUT_COUNT,
    OUT_WIDTH
};

/* A number beyond this is no place on Earth, in metres: it is left out before it can overflow. */
static const double TOO_FAR = 1e9;

/* Keeps the derivative finite where the path runs through an anchor (a micrometre off it). */
static const double TINY2 = 1e-12;

typedef struct {
    double dof;             /* degrees of freedom of the Student-t; 0 means Gaussian */
    double scale_floor;     /* the estimated scale is never below this multiple of sigma */
    double fixed_scale;     /* above 0: use this scale, estimate none */
    double bias_sigma;      /* the problem's prior standard deviation of the bias; 0: it is fixed */
    double tolerance;       /* converged when a step is shorter than this many standard errors */
    long max_iterations;
    long max_lag;           /* lags of the long-run variance of the score */
    long min_ranges;
} Settings;

/* The usable ranges of one problem; `inv_var` is 1 / sigma^2. */
typedef struct {
    double *east, *north, *gap2, *range, *inv_var;
    double *weight;         /* robust weight times inv_var / scale^2, set by evaluate() */
    double *misfit;         /* squared residual in units of sigma^2, set by measure() */
    double *work;           /* weights of a start, factors of a product */
    double *running;        /* running sums of the score, see long_run_variance() */
    long n;
} Problem;

typedef struct {
    double east, north, bias, scale;
} State;

/* Sums over the ranges at one state: normal equations of place and bias, and the cost. */
typedef struct {
    double ee, en, nn, eb, nb, bb;  /* information: sum of weight times Jacobian products */
    double ge, gn, gb;              /* gradient: sum of weight times residual times Jacobian */
    double previous_cost;           /* sum of the previous weights times residual squared */
    double cost;                    /* sum of the new weights times residual squared */
} Sums;

/* Copy a problem's ranges, then close the gaps that unusable ones leave. */
FAST static void gather(Problem *restrict q, const double *restrict position,
                        const double *restrict tag_up, double anchor_up,
                        const double *restrict range, const double *restrict sigma, long steps)
{
    double *restrict east = q->east, *restrict north = q->north, *restrict gap2 = q->gap2;
    double *restrict measured = q->range, *restrict inv_var = q->inv_var;
    const int flat = isnan(anchor_up);  /* unknown height */
    long usable = 0;
    INDEPENDENT
    for (long t = 0; t < steps; t++) {
        double gap = flat ? 0.0 : tag_up[t] - anchor_up, s = sigma[t];
        east[t] = position[2 * t];
        north[t] = position[2 * t + 1];
        gap2[t] = gap * gap;
        measured[t] = range[t];
        double size = fabs(east[t]) + fabs(north[t]) + fabs(gap) + fabs(range[t]);
        int good = (size < TOO_FAR) & (s > 1.0 / TOO_FAR) & (s < TOO_FAR);  /* a NaN is not */
        inv_var[t] = good ? 1.0 / (s * s) : 0.0;
        usable += good;
    }
    q->n = usable;
    for (long t = 0, n = 0; usable < steps && t < steps; t++) {
        east[n] = east[t]; north[n] = north[t]; gap2[n] = gap2[t];
        measured[n] = measured[t]; inv_var[n] = inv_var[t];
        n += inv_var[t] > 0.0;
    }
}

/* Evaluate residuals at a state, set the weights that belong to them, and sum. Inlined with
 * constant `robust` and `with_bias`, so that each kind of problem pays for its own sums only. */
static inline __attribute__((always_inline)) void sum_up(
    const Problem *restrict q, const State *restrict s, double dof, int robust, int with_bias,
    Sums *restrict out)
{
    const double *restrict east = q->east, *restrict north = q->north, *restrict gap2 = q->gap2;
    const double *restrict range = q->range, *restrict inv_var = q->inv_var;
    double *restrict weight = q->weight;
    const double x = s->east, y = s->north, offset = with_bias ? s->bias : 0.0;
    const double inv_scale2 = 1.0 / (s->scale * s->scale);
    double ee = 0, en = 0, nn = 0, eb = 0, nb = 0, bb = 0, ge = 0, gn = 0, gb = 0;
    double previous = 0, cost = 0;
    const long n = q->n;
    INDEPENDENT
    for (long t = 0; t < n; t++) {
        double dx = x - east[t], dy = y - north[t];
        double slant = sqrt(dx * dx + dy * dy + gap2[t] + TINY2);
        double r = slant + offset - range[t], r2 = r * r;
        double w = inv_var[t] * inv_scale2, inv;
        if (robust) {
            double spread = dof + r2 * w;
            double reciprocal = 1.0 / (slant * spread);  /* one division does for two */
            inv = reciprocal * spread;
            w *= (dof + 1.0) * reciprocal * slant;
        } else {
            inv = 1.0 / slant;
        }
        previous += weight[t] * r2;
        cost += w * r2;
        weight[t] = w;
        double ux = dx * inv, uy = dy * inv, wx = w * ux, wy = w * uy;
        ee += wx * ux; en += wx * uy; nn += wy * uy;
        ge += wx * r; gn += wy * r;
        if (with_bias) {
            eb += wx; nb += wy; bb += w; gb += w * r;
        }
    }
    out->ee = ee; out->en = en; out->nn = nn; out->eb = eb; out->nb = nb; out->bb = bb;
    out->ge = ge; out->gn = gn; out->gb = gb;
    out->previous_cost = previous;
    out->cost = cost;
}

/* The same with the bias's Gaussian prior, if there is a bias. */
FAST static void evaluate(const Problem *q, const State *s, const Settings *set, Sums *out)
{
    if (set->bias_sigma <= 0.0) {
        if (set->dof > 0.0) sum_up(q, s, set->dof, 1, 0, out);
        else sum_up(q, s, 0.0, 0, 0, out);
        return;
    }
    if (set->dof > 0.0) sum_up(q, s, set->dof, 1, 1, out);
    else sum_up(q, s, 0.0, 0, 1, out);
    out->bb += 1.0 / (set->bias_sigma * set->bias_sigma);
    out->gb += s->bias / (set->bias_sigma * set->bias_sigma);
}

/* Set the misfits at a state. */
FAST static void measure(const Problem *restrict q, const State *restrict s)
{
    const double *restrict east = q->east, *restrict north = q->north, *restrict gap2 = q->gap2;
    const double *restrict range = q->range, *restrict inv_var = q->inv_var;
    double *restrict misfit = q->misfit;
    const double x = s->east, y = s->north, offset = s->bias;
    const long n = q->n;
    INDEPENDENT
    for (long t = 0; t < n; t++) {
        double dx = x - east[t], dy = y - north[t];
        double r = sqrt(dx * dx + dy * dy + gap2[t] + TINY2) + offset - range[t];
        misfit[t] = r * r * inv_var[t];
    }
}

/* Sum of the logarithms of positive numbers. Multiplying spares nearly all logarithms. */
static double sum_of_logs(const double *x, long n)
{
    double total = 0.0, product = 1.0;
    long t = 0;
    for (; t + 4 <= n; t += 4) {
        product *= (x[t] * x[t + 1]) * (x[t + 2] * x[t + 3]);
        if (!(product > 1e-100 && product < 1e100)) {
            total += log(product);
            product = 1.0;
        }
    }
    for (; t < n; t++) product *= x[t];
    return total + log(product);
}

/* Robust scale of the misfits: their geometric mean, which one far outlier hardly moves, times the
 * factor that makes it the standard deviation of a Gaussian. */
FAST static double robust_scale(const Problem *q, double floor)
{
    const double least = floor * floor;
    for (long t = 0; t < q->n; t++) q->work[t] = q->misfit[t] > least ? q->misfit[t] : least;
    return 1.887 * exp(0.5 * sum_of_logs(q->work, q->n) / (double)q->n);
}

/* Information of a Student-t error as a share of its expected robust weight; Gaussian: 1. */
static double fisher_share(double dof)
{
    return dof > 0.0 ? (dof + 1.0) / (dof + 3.0) : 1.0;
}

static double clamp_scale(double scale, const Settings *set)
{
    return set->fixed_scale > 0.0 ? set->fixed_scale : fmax(scale, set->scale_floor);
}

/* The path's weighted mean and the unit vector along its principal axis. */
typedef struct {
    double east, north, cosine, sine;
} Axis;

/* Moments of the squared-range cost about the weighted mean of the path; see start(). */
typedef struct {
    double east, north;          /* weighted mean */
    double see, sen, snn;        /* weighted scatter of the path */
    double ge, gn, mean_q;
} Moments;

FAST static void moments(const Problem *restrict q, Moments *restrict m)
{
    const double *restrict east = q->east, *restrict north = q->north, *restrict w = q->work;
    const double *restrict gap2 = q->gap2, *restrict range = q->range;
    double sum = 0, sx = 0, sy = 0;
    for (long t = 0; t < q->n; t++) {
        sum += w[t]; sx += w[t] * east[t]; sy += w[t] * north[t];
    }
    const double inv_sum = 1.0 / sum, mx = sx * inv_sum, my = sy * inv_sum;
    double see = 0, sen = 0, snn = 0, ge = 0, gn = 0, mq = 0;
    for (long t = 0; t < q->n; t++) {
        double dx = east[t] - mx, dy = north[t] - my, wx = w[t] * dx, wy = w[t] * dy;
        double k = dx * dx + dy * dy + gap2[t] - range[t] * range[t];
        see += wx * dx; sen += wx * dy; snn += wy * dy;
        ge += wx * k; gn += wy * k; mq += w[t] * k;
    }
    m->east = mx; m->north = my;
    m->see = see * inv_sum; m->sen = sen * inv_sum; m->snn = snn * inv_sum;
    m->ge = ge * inv_sum; m->gn = gn * inv_sum; m->mean_q = mq * inv_sum;
}

/* Return mu = lambda + a2 for the largest root of  lambda = g1^2/(lambda+a1)^2 + g2^2/(lambda+a2)^2,
 * a1 >= a2, on mu > 0, where the right-hand side (called x2, it is |x|^2) falls from infinity.
 * Bracketed Newton on sqrt(lambda / x2) - 1, which is nearly linear also beside the pole. */
static double secular_root(double g1, double a1, double g2, double a2)
{
    const double gap = a1 - a2;
    double low = fmax(a2, 0.0);
    double high = 2.0 * low + cbrt(2.0 * (g1 * g1 + g2 * g2));  /* there lambda >= mu/2 >= x2 */
    /* At the root lambda > -a2 and |g1| / (mu + gap) < |g1| / gap: for a path that is nearly
     * straight, a bound so tight that a step or two remain. */
    double across2 = -a2 - (g1 / gap) * (g1 / gap);
    if (across2 > 0.0) high = fmin(high, fabs(g2) / sqrt(across2));
    double mu = high;
    for (int k = 0; k < 60 && mu > 0.0; k++) {
        double p = 1.0 / (mu + gap), r = 1.0 / mu, lambda = mu - a2;
        double u = g1 * p * g1 * p, v = g2 * r * g2 * r, x2 = u + v;
        double ratio = sqrt(lambda / x2);
        double next = mu - (1.0 - 1.0 / ratio) / (0.5 / lambda + (u * p + v * r) / x2);
        if (fabs(next - mu) <= 1e-7 * mu) return next;  /* enough for a start */
        if (ratio > 1.0) high = mu; else low = mu;
        mu = next > low && next < high ? next : 0.5 * (low + high);
    }
    return mu;
}

/* Global minimum of sum w (|x - p|^2 + gap^2 - d^2)^2 for the weights in `work`. With c the path's
 * mean, S its scatter, q = |p - c|^2 + gap^2 - d^2 and g = mean of q (p - c), stationary points
 * satisfy (lambda + mean q + 2 S) (x - c) = g with lambda = |x - c|^2: one scalar equation in S's
 * axes (Beck, Stoica and Li 2008). */
static State start(const Problem *q, Axis *axis)
{
    Moments m;
    moments(q, &m);
    double half = 0.5 * (m.see + m.snn), lean = 0.5 * (m.see - m.snn);
    double spread = sqrt(lean * lean + m.sen * m.sen);
    double c = 1.0, s = 0.0;
    if (spread > 0.0) {  /* half-angle formulas, the one without cancellation */
        double large = sqrt(0.5 + 0.5 * fabs(lean) / spread), small = 0.5 * m.sen / (spread * large);
        c = lean >= 0.0 ? large : small;
        s = lean >= 0.0 ? small : large;
    }
    double minor = 2.0 * fmax(half - spread, 0.0) + m.mean_q;
    double major = 2.0 * (half + spread) + m.mean_q;
    double g_major = c * m.ge + s * m.gn, g_minor = c * m.gn - s * m.ge;
    /* The place along the path if lambda = -minor; a parked vehicle has no path. */
    double along = major > minor ? g_major / (major - minor) : 0.0, across;
    if (minor < 0.0 && fabs(g_minor) <= 1e-12 * fabs(minor) * sqrt(fabs(minor))
        && -minor >= along * along) {
        /* A straight path: both sides fit alike and the gradient across it vanishes. */
        across = sqrt(-minor - along * along);
    } else {
        double mu = secular_root(g_major, major, g_minor, minor);
        along = g_major / (mu + (major - minor));
        across = mu > 0.0 ? g_minor / mu : 0.0;
    }
    *axis = (Axis){m.east, m.north, c, s};
    return (State){m.east + c * along - s * across, m.north + s * along + c * across, 0.0, 1.0};
}

/* Reflect a place in the path's principal axis. */
static State mirrored(State state, const Axis *axis)
{
    double across = axis->cosine * (state.north - axis->north)
                  - axis->sine * (state.east - axis->east);
    state.east += 2.0 * axis->sine * across;
    state.north -= 2.0 * axis->cosine * across;
    return state;
}

/* Set the weights of the squared-range cost. The error of d^2 is 2 d times the error of d; with a
 * scale above 0, Geman-McClure's weight at the current misfit leaves a far outlier no say. */
FAST static void start_weights(const Problem *restrict q, double scale)
{
    const double *restrict range = q->range, *restrict inv_var = q->inv_var;
    const double *restrict misfit = q->misfit;
    double *restrict w = q->work;
    const double inv_scale2 = scale > 0.0 ? 1.0 / (scale * scale) : 0.0;
    const long n = q->n;
    INDEPENDENT
    for (long t = 0; t < n; t++) {
        double u = 1.0 + (scale > 0.0 ? misfit[t] * inv_scale2 : 0.0);
        w[t] = inv_var[t] / (u * u * (range[t] * range[t] + 0.25));
    }
}

/* The start; for robust errors again with the weights that the first one's misfits call for. */
static State robust_start(const Problem *q, const Settings *set, Axis *axis)
{
    start_weights(q, 0.0);
    State state = start(q, axis);
    if (set->dof > 0.0) {
        measure(q, &state);
        double scale = clamp_scale(robust_scale(q, set->scale_floor), set);
        start_weights(q, scale);
        state = start(q, axis);
        state.scale = scale;
    }
    return state;
}

/* One damped step of place and bias, stretched to `length` times its own; the bias is eliminated
 * first (its Jacobian is 1). */
static void step_of(const Sums *a, double damping, double length, int with_bias, double step[3])
{
    double ee = a->ee * (1.0 + damping), en = a->en, nn = a->nn * (1.0 + damping);
    double ge = a->ge, gn = a->gn, bb = a->bb * (1.0 + damping);
    if (with_bias) {
        ee -= a->eb * a->eb / bb; en -= a->eb * a->nb / bb; nn -= a->nb * a->nb / bb;
        ge -= a->eb * a->gb / bb; gn -= a->nb * a->gb / bb;
    }
    double ridge = 1e-12 * (ee + nn);
    ee += ridge; nn += ridge;
    double inverse = length / (ee * nn - en * en);
    step[0] = -(nn * ge - en * gn) * inverse;
    step[1] = -(ee * gn - en * ge) * inverse;
    step[2] = with_bias ? -(length * a->gb + a->eb * step[0] + a->nb * step[1]) / bb : 0.0;
}

static double prior_cost(const State *s, const Settings *set)
{
    double u = set->bias_sigma > 0.0 ? s->bias / set->bias_sigma : 0.0;
    return u * u;
}

/* Maximise the likelihood from a state. Weights at the current residuals make a quadratic that
 * touches the negative log likelihood from above (expectation-maximisation); the step to its
 * minimum is stretched by the ratio of its curvature to the Fisher information, which is the same
 * for place and scale: Fisher scoring. With a stretch of at most 2 (dof of at least 1) the quadratic
 * never ascends. Returns whether it converged; the last step, too short to matter, is taken
 * without another evaluation. */
static int refine(const Problem *q, const Settings *set, State *state, long *iterations)
{
    const int with_bias = set->bias_sigma > 0.0, robust = set->dof > 0.0;
    const double stretch = 1.0 / fisher_share(set->dof);
    double damping = 1e-4;
    Sums sums, trial;  /* at the state and at the next one */
    evaluate(q, state, set, &sums);
    for (*iterations = 1; *iterations <= set->max_iterations; ++*iterations) {
        double step[3];
        step_of(&sums, damping, stretch, with_bias, step);
        /* Mean squared residual in units of the scale; the number of ranges that it is divided by
         * counts a robust weight as its share of a range (Liu, Rubin and Wu 1998). */
        double mean = sums.cost / (double)q->n;
        if (robust) mean *= set->dof / (set->dof + 1.0 - mean);
        State next = {state->east + step[0], state->north + step[1], state->bias + step[2],
                      clamp_scale(state->scale * (robust ? pow(mean, 0.5 * stretch) : sqrt(mean)),
                                  set)};
        double rescale = next.scale / state->scale;
        double decrement = -(step[0] * sums.ge + step[1] * sums.gn + step[2] * sums.gb);
        int settled = fabs(rescale - 1.0) < set->tolerance || !(robust || with_bias);
        if (settled && decrement < set->tolerance * set->tolerance * rescale * rescale) {
            *state = next;
            return 1;
        }
        evaluate(q, &next, set, &trial);
        if (trial.previous_cost + prior_cost(&next, set)
            <= (sums.cost + prior_cost(state, set)) * (1.0 + 1e-12)) {
            *state = next;
            sums = trial;
            damping *= 0.1;
        } else {
            /* Worse under the same weights: stay, restore the weights, shorten the step. */
            damping = damping * 16.0 + 1e-6;
            if (damping > 1e12) return 0;
            evaluate(q, state, set, &sums);
        }
    }
    *iterations = set->max_iterations;
    return 0;
}

/* Negative log likelihood of ranges with these misfits, up to a constant that is the same for both
 * hypotheses. */
FAST static double negative_log_likelihood(const Problem *q, double scale, double dof)
{
    const double inv_scale2 = 1.0 / (scale * scale);
    const double total = (double)q->n * log(scale);
    if (dof > 0.0) {
        for (long t = 0; t < q->n; t++) q->work[t] = 1.0 + q->misfit[t] * inv_scale2 / dof;
        return total + 0.5 * (dof + 1.0) * sum_of_logs(q->work, q->n);
    }
    double sum = 0.0;
    for (long t = 0; t < q->n; t++) sum += q->misfit[t];
    return total + 0.5 * sum * inv_scale2;
}

/* Fisher information over (east, north, bias), and the scores, laid out for running sums: each of
 * the three columns has `lags` zeros and a first sum of zero in front. */
FAST static void scores(const Problem *restrict q, const State *restrict s, double dof, long lags,
                        double *restrict info)
{
    const double *restrict east = q->east, *restrict north = q->north, *restrict gap2 = q->gap2;
    const double *restrict range = q->range, *restrict inv_var = q->inv_var;
    double *restrict misfit = q->misfit;
    const long n = q->n, length = n + 2 * lags + 1;
    double *restrict se = q->running + lags + 1, *restrict sn = se + length;
    double *restrict sb = sn + length;
    const double x = s->east, y = s->north, offset = s->bias;
    const double inv_scale2 = 1.0 / (s->scale * s->scale);
    const double base = dof > 0.0 ? dof : 1.0, gain = dof > 0.0 ? dof + 1.0 : 1.0;
    const double tail = dof > 0.0 ? 1.0 : 0.0;
    double ee = 0, en = 0, nn = 0, eb = 0, nb = 0, bb = 0;
    INDEPENDENT
    for (long t = 0; t < n; t++) {
        double dx = x - east[t], dy = y - north[t];
        double slant = sqrt(dx * dx + dy * dy + gap2[t] + TINY2);
        double r = slant + offset - range[t], u2 = r * r * inv_var[t];
        double spread = base + tail * u2 * inv_scale2;
        double reciprocal = 1.0 / (slant * spread), inv = reciprocal * spread;
        double w = inv_var[t] * inv_scale2 * gain * reciprocal * slant;
        double ux = dx * inv, uy = dy * inv, wx = w * ux, wy = w * uy;
        misfit[t] = u2;
        se[t] = wx * r; sn[t] = wy * r; sb[t] = w * r;
        ee += wx * ux; en += wx * uy; nn += wy * uy;
        eb += wx; nb += wy; bb += w;
    }
    const double share = fisher_share(dof);
    info[0] = share * ee; info[1] = share * en; info[2] = share * nn;
    info[3] = share * eb; info[4] = share * nb; info[5] = share * bb;
}

/* Long-run variance of the score (Newey and West 1987, Bartlett weights): what the information
 * matrix would be worth if errors were independent, corrected for the fact that they are not.
 * Bartlett's weighted sum of lagged products is the mean product of moving sums over lags + 1
 * scores, and those are differences of running sums, so any number of lags costs the same.
 * Returns the factor by which correlation inflates the variance of the mean residual. */
FAST static double long_run_variance(const Problem *restrict q, long lags, double *restrict out)
{
    const long n = q->n, length = n + 2 * lags + 1;
    double *restrict se = q->running, *restrict sn = se + length, *restrict sb = sn + length;
    double variance = 0.0, e_sum = 0.0, n_sum = 0.0, b_sum = 0.0;
    for (long t = 0; t <= lags; t++) se[t] = sn[t] = sb[t] = 0.0;
    for (long t = lags + 1; t <= lags + n; t++) {
        variance += sb[t] * sb[t];
        se[t] = e_sum += se[t]; sn[t] = n_sum += sn[t]; sb[t] = b_sum += sb[t];
    }
    for (long t = lags + n + 1; t < length; t++) se[t] = e_sum, sn[t] = n_sum, sb[t] = b_sum;
    double ee = 0, en = 0, nn = 0, eb = 0, nb = 0, bb = 0;
    for (long t = 0; t < n + lags; t++) {
        double e = se[t + lags + 1] - se[t], m = sn[t + lags + 1] - sn[t];
        double b = sb[t + lags + 1] - sb[t];
        ee += e * e; en += e * m; nn += m * m;
        eb += e * b; nb += m * b; bb += b * b;
    }
    const double share = 1.0 / (double)(lags + 1);
    out[0] = ee * share; out[1] = en * share; out[2] = nn * share;
    out[3] = eb * share; out[4] = nb * share; out[5] = bb * share;
    return variance > 0.0 ? fmax(out[5] / variance, 1.0) : 1.0;
}

static void summarise(const Problem *q, const Settings *set, const State *s, double *out)
{
    const long lags = set->max_lag < q->n - 1 ? set->max_lag : q->n - 1;
    scores(q, s, set->dof, lags, out + OUT_INFO_EE);
    out[OUT_NLL] = negative_log_likelihood(q, s->scale, set->dof) + 0.5 * prior_cost(s, set);
    if (set->bias_sigma > 0.0) out[OUT_INFO_BB] += 1.0 / (set->bias_sigma * set->bias_sigma);
    out[OUT_CORRELATION] = long_run_variance(q, lags, out + OUT_MEAT_EE);
    out[OUT_EAST] = s->east; out[OUT_NORTH] = s->north;
    out[OUT_BIAS] = s->bias; out[OUT_SCALE] = s->scale;
}

static void solve_one(const Problem *q, const Settings *set, double *out)
{
    for (int k = 0; k < 2 * OUT_WIDTH; k++) out[k] = NAN;
    out[OUT_COUNT] = out[OUT_WIDTH + OUT_COUNT] = (double)q->n;
    if (q->n < set->min_ranges) return;
    Axis axis;
    State state = robust_start(q, set, &axis);
    for (int k = 0; k < 2; k++, out += OUT_WIDTH) {
        long iterations;
        out[OUT_CONVERGED] = refine(q, set, &state, &iterations);
        out[OUT_ITERATIONS] = (double)iterations;
        summarise(q, set, &state, out);
        state = mirrored(state, &axis);
    }
}

/* One block for all columns of a problem of up to `steps` ranges; free it by `east`. Running sums
 * need 3 (n + 2 lags + 1) with lags below n. */
static int allocate(Problem *q, size_t steps)
{
    double *block = calloc(steps + 1, 17 * sizeof(double));
    double **column[] = {&q->east, &q->north, &q->gap2, &q->range,
                         &q->inv_var, &q->weight, &q->misfit, &q->work};
    for (size_t k = 0; block && k < 8; k++) *column[k] = block + k * steps;
    if (block) q->running = block + 8 * steps;
    return block != NULL;
}

static PyObject *solve(PyObject *module, PyObject *args)
{
    Py_buffer position, tag_up, range, sigma, anchor_up, bias_sigma, out;
    Py_ssize_t episodes, anchors, steps;
    Settings set;
    (void)module;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*w*nnnddddlll", &position, &tag_up, &range, &sigma,
                          &anchor_up, &bias_sigma, &out, &episodes, &anchors, &steps, &set.dof,
                          &set.scale_floor, &set.fixed_scale, &set.tolerance,
                          &set.max_iterations, &set.max_lag, &set.min_ranges))
        return NULL;
    const Py_ssize_t problems = episodes * anchors, cell = sizeof(double);
    int fits = position.len == episodes * steps * 2 * cell && tag_up.len == episodes * steps * cell
            && range.len == problems * steps * cell && sigma.len == range.len
            && anchor_up.len == problems * cell && bias_sigma.len == problems * cell
            && out.len == problems * 2 * OUT_WIDTH * cell
            && set.min_ranges >= 3 && set.max_lag >= 0;
    Problem q;
    int ready = fits && allocate(&q, (size_t)steps);
    if (ready) {
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t p = 0; p < problems; p++) {
            Py_ssize_t b = p / anchors;
            gather(&q, (double *)position.buf + b * steps * 2, (double *)tag_up.buf + b * steps,
                   ((double *)anchor_up.buf)[p], (double *)range.buf + p * steps,
                   (double *)sigma.buf + p * steps, (long)steps);
            set.bias_sigma = ((double *)bias_sigma.buf)[p];
            solve_one(&q, &set, (double *)out.buf + p * 2 * OUT_WIDTH);
        }
        Py_END_ALLOW_THREADS
        free(q.east);
    } else if (fits) {
        PyErr_NoMemory();
    } else {
        PyErr_SetString(PyExc_ValueError, "buffer sizes or settings do not fit the dimensions");
    }
    Py_buffer *buffers[] = {&position, &tag_up, &range, &sigma, &anchor_up, &bias_sigma, &out};
    for (int k = 0; k < 7; k++) PyBuffer_Release(buffers[k]);
    if (!ready) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"solve", solve, METH_VARARGS, "Solve problems in place; see multilateration.py."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "gaia_uwb.solver._solver", "The solver's inner loop.", -1, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__solver(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (module && PyModule_AddIntConstant(module, "WIDTH", OUT_WIDTH) < 0) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
