/* The estimator's inner loop: what single readings say near a guess, averaged over cells.
 *
 * range_model.py holds the interface and the model in words; this file holds the part that must be
 * fast. Each block (one cone in one drive) is worked on by itself, for both places of its cone, in
 * columns that a processor's cache holds:
 *   1. look        geometry: derivatives and residual of every reading
 *   2. compare     densities of every reading, visible or hidden, given the one before it in time
 *   3. smooth      forward-backward recursions: was it hidden?
 *   4. tally       likelihood, hidden readings, and how alike neighbours are
 *   5. average     robust mean of derivatives and residuals of every cell
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

/* One source, the widest vector unit that the machine has at run time. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define FAST __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FAST
#endif

/* The columns of a block never overlap; without the word the compiler must assume they may. */
#if defined(__clang__)
#define INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define INDEPENDENT _Pragma("GCC ivdep")
#else
#define INDEPENDENT
#endif

/* Numbers of a cone on one side, and of a block; see Guess in range_model.py. */
enum { EAST, NORTH, DELAY, COSINE, SINE, OWN };
enum { BIAS_M, GROWTH_M, NOISE_M, ALIKE, SHARE, PATTERN_M, ERRORS = PATTERN_M + 4 };

/* What a mean is of: derivatives by a cone's own unknowns (above), then by these, and the residual.
 * Those by DELAY, BIAS and TAG_BIAS are 1 everywhere. */
enum { BIAS = OWN, GROWTH, CLOCK, TAG_BIAS, TURN, RESIDUAL = TURN + 4, COLUMNS };

enum { LOSS, HIDDEN, SQUARE, PRODUCT, PAIR_SQUARE, TALLIES };

/* Geometry. */
static const double NEAREST_M = 0.5;        /* below this a range bias does not grow any more */
static const double PARKED_MPS = 0.2;       /* below this the direction of travel is unknown */
static const double TINY_M = 1e-9;          /* keeps derivatives finite on top of a cone */
static const double LEAST_INFORMATION = 1e-2;   /* of a cell that is all hidden, per m^2 */

/* Noise: Student-t with four degrees of freedom, whose density at 0 is 3/8. */
static const double DEGREES = 4.0, T_AT_0 = 0.375;

/* Lines of sight. */
static const double KEPT_S = 1.5;           /* how long a line of sight, or none, lasts */
static const double TOO_LONG_M = 1.0;       /* scale of what hidden readings are too long by */
static const double STRANGE_M = 50.0;       /* the same where they are not of this cone at all */
static const double STRANGE = 0.1;          /* how common that is among them */
static const double TOO_SHORT = 0.1;        /* share of hidden ones that are too short instead */
static const double LIKE_BEFORE = 0.7;      /* share that err like the hidden one before */
static const double DRIFT_M = 0.2;          /* what these differ by after a long time */
static const double APART_S = 0.1;          /* of readings whose noise is as correlated as stated */
static const double MOST_ALIKE = 0.98;      /* no reading only repeats the one before */
static const double NEIGHBOURS_S = 0.3;     /* closer readings tell how correlated the noise is */

/* All readings of some cones, sorted by cone, block and cell, and where they are looked at. */
typedef struct {
    Py_ssize_t n_readings, n_cells, n_blocks, n_cones;
    const double *position, *velocity, *gap, *range;    /* by reading, the first two in pairs */
    const int64_t *order;                       /* a block's readings, from its first, by time */
    const double *after;                        /* seconds since the one before, in that order */
    const int64_t *first_row, *first_cell;      /* of each cell, of each block, and the end */
    const int64_t *cone;                        /* of each block */
    const double *own, *errors;                 /* guess: by side and block; by block */
    const double *slow, *variance;              /* slow errors: by side and cell */
    double *information, *mean;                 /* found: by side and cell */
    double *tally;                              /* by side and cone */
    int64_t *nearest;                           /* by side and cone: reading nearest to the place */
} Readings;

/* One block on one side: its rows, and columns for what is found of them. */
typedef struct {
    Py_ssize_t first, n, first_cell, n_cells;
    const double *own, *errors;
    /* In the order of rows: what a mean is of, and what a reading is worth. */
    double *column[COLUMNS], *flat, *left, *inverse, *square, *seen, *worth;
    /* In the order of time; the first three are the same on both sides. Before the first error
     * there is a 0. */
    double *same, *alike, *sharper, *scale, *visible, *still_visible, *new_hidden, *still_hidden;
    double *evidence, *after_hidden, *after_visible, *hidden, *error;
} Block;

enum { WORK_COLUMNS = COLUMNS + 19 };

/* Unlike fmax() it is no call. */
static inline double larger(double a, double b) { return a > b ? a : b; }

/* How alike a reading and the one before it in time are: as little as can be for the first. */
static void connect(const Readings *z, Block *b)
{
    const double *restrict after = z->after + b->first;
    const double log_alike = log(b->errors[ALIKE]);
    for (Py_ssize_t i = 1; i < b->n; i++) {
        b->same[i] = exp(-after[i] / KEPT_S);
        const double alike = after[i] > 0.0 ? exp(log_alike * (after[i] / APART_S)) : MOST_ALIKE;
        b->alike[i] = fmin(alike, MOST_ALIKE);
    }
    b->same[0] = b->alike[0] = 0.0;
    for (Py_ssize_t i = 0; i < b->n; i++)
        b->sharper[i] = 1.0 / sqrt(1.0 - b->alike[i] * b->alike[i]);
}

/* Derivatives of every range, and what is left of it. */
FAST static void look(const Readings *z, Block *b)
{
    const double *restrict position = z->position + 2 * b->first;
    const double *restrict velocity = z->velocity + 2 * b->first;
    const double *restrict gap = z->gap + b->first, *restrict range = z->range + b->first;
    const double *own = b->own, *errors = b->errors, *pattern = errors + PATTERN_M;
    double *restrict flat_m = b->flat, *restrict decades = b->column[GROWTH];
    double *restrict by_east = b->column[EAST], *restrict by_north = b->column[NORTH];
    double *restrict by_cosine = b->column[COSINE], *restrict by_sine = b->column[SINE];
    double *restrict by_clock = b->column[CLOCK], *restrict residual = b->column[RESIDUAL];
    double *restrict turn_1 = b->column[TURN], *restrict turn_2 = b->column[TURN + 1];
    double *restrict turn_3 = b->column[TURN + 2], *restrict turn_4 = b->column[TURN + 3];
    INDEPENDENT
    for (Py_ssize_t r = 0; r < b->n; r++) {
        const double east = own[EAST] - position[2 * r], north = own[NORTH] - position[2 * r + 1];
        const double flat2 = east * east + north * north;
        const double flat = sqrt(flat2) + TINY_M, distance = sqrt(flat2 + gap[r] * gap[r]) + TINY_M;
        const double vx = velocity[2 * r], vy = velocity[2 * r + 1];
        const double speed = sqrt(vx * vx + vy * vy);
        const double per_speed = speed > PARKED_MPS ? 1.0 / speed : 0.0;
        const double cosine = east / flat, sine = north / flat;
        const double ahead = vx * per_speed, left = vy * per_speed;
        const double c = cosine * ahead + sine * left, s = sine * ahead - cosine * left;
        flat_m[r] = flat;
        decades[r] = larger(distance, NEAREST_M) / 10.0;      /* of which the logarithm follows */
        by_east[r] = east / distance;
        by_north[r] = north / distance;
        by_cosine[r] = cosine;
        by_sine[r] = sine;
        by_clock[r] = by_east[r] * vx + by_north[r] * vy;
        turn_1[r] = c;
        turn_2[r] = s;
        turn_3[r] = c * c - s * s;
        turn_4[r] = 2.0 * c * s;
        residual[r] = range[r] - distance - own[DELAY] - errors[BIAS_M]
                    - own[COSINE] * cosine - own[SINE] * sine - pattern[0] * c - pattern[1] * s
                    - pattern[2] * turn_3[r] - pattern[3] * turn_4[r];
    }
    for (Py_ssize_t r = 0; r < b->n; r++) {
        decades[r] = log10(decades[r]);
        residual[r] -= errors[GROWTH_M] * decades[r];
    }
}

/* Take the slow error of its cell out of every residual, and standardise what is left. */
FAST static void take_out(const Readings *z, Block *b, const double *slow, const double *variance)
{
    const double noise2 = b->errors[NOISE_M] * b->errors[NOISE_M];
    const double *restrict residual = b->column[RESIDUAL];
    for (Py_ssize_t c = b->first_cell; c < b->first_cell + b->n_cells; c++) {
        /* What is not known yet of a slow error would else seem hidden. */
        const double inverse = 1.0 / sqrt(noise2 + variance[c]);
        for (Py_ssize_t r = z->first_row[c] - b->first; r < z->first_row[c + 1] - b->first; r++) {
            b->left[r] = residual[r] - slow[c];
            b->inverse[r] = inverse;
            b->square[r] = (b->left[r] * b->left[r] + variance[c]) / noise2;
        }
    }
}

static inline double student(double left, double inverse)
{
    const double size = left * inverse, u = 1.0 + size * size / DEGREES;
    return T_AT_0 * inverse / (u * u * sqrt(u));        /* u to the power of (DEGREES + 1) / 2 */
}

/* Densities of every reading, visible or hidden, as the first of its kind or after another. None
 * underflows: the noise has heavy tails, and a floor is under that of hidden ones. */
FAST static void compare(const Readings *z, Block *b)
{
    const int64_t *restrict order = z->order + b->first;
    double *restrict left = b->error, *restrict inverse = b->scale;
    double *restrict new_hidden = b->new_hidden, *restrict still_hidden = b->still_hidden;
    double *restrict visible = b->visible, *restrict still_visible = b->still_visible;
    const double *restrict same = b->same, *restrict alike = b->alike;
    const double *restrict sharper = b->sharper;
    for (Py_ssize_t i = 0; i < b->n; i++) {
        left[i] = b->left[order[i]];
        inverse[i] = b->inverse[order[i]];
        const double size = fabs(left[i]);
        const double density = (1.0 - STRANGE) * exp(-size / TOO_LONG_M) / TOO_LONG_M
                             + STRANGE * exp(-size / STRANGE_M) / STRANGE_M;
        new_hidden[i] = larger(density * (left[i] > 0.0 ? 1.0 - TOO_SHORT : TOO_SHORT), 1e-300);
    }
    INDEPENDENT
    for (Py_ssize_t i = 0; i < b->n; i++) {
        const double before = left[i - 1];
        const double drift2 = 2.0 * DRIFT_M * DRIFT_M * (1.0 - same[i]);
        const double wide2 = 2.0 / (inverse[i] * inverse[i]) + drift2;
        const double like = student(left[i] - before, 1.0 / sqrt(wide2));
        visible[i] = student(left[i], inverse[i]);
        still_visible[i] = student(left[i] - alike[i] * before, inverse[i] * sharper[i]);
        still_hidden[i] = LIKE_BEFORE * like + (1.0 - LIKE_BEFORE) * new_hidden[i];
    }
}

/* From one reading to the next the state is kept with probability `same`, and otherwise drawn anew:
 * hidden with probability `share`. Two columns keep how likely the reading before was hidden if
 * this one is hidden, or visible. */
static void smooth(Block *b)
{
    const double share = b->errors[SHARE];
    double out = 0.0;                                   /* the reading before was hidden */
    for (Py_ssize_t i = 0; i < b->n; i++) {
        const double same = b->same[i], anew = 1.0 - same, in = 1.0 - out;
        const double visible = anew * (1.0 - share) * b->visible[i];
        const double hidden = anew * share * b->new_hidden[i];
        const double out_out = out * (same * b->still_hidden[i] + hidden);
        const double in_in = in * (same * b->still_visible[i] + visible);
        const double is_out = out_out + in * hidden, is_in = out * visible + in_in;
        b->evidence[i] = is_out + is_in;
        b->after_hidden[i] = out_out / larger(is_out, 1e-300);
        b->after_visible[i] = out * visible / larger(is_in, 1e-300);
        b->hidden[i] = out = is_out / b->evidence[i];
    }
    for (Py_ssize_t i = b->n - 2; i >= 0; i--) {
        const double next = b->hidden[i + 1];
        b->hidden[i] = next * b->after_hidden[i + 1] + (1.0 - next) * b->after_visible[i + 1];
    }
}

/* Add up what the chain tells, and note what every reading is worth. */
FAST static void tally(const Readings *z, Block *b, double *out)
{
    const int64_t *restrict order = z->order + b->first;
    const double *restrict after = z->after + b->first;
    double loss = 0.0, hidden = 0.0, products = 0.0, squares = 0.0, weighted = 0.0;
    for (Py_ssize_t i = 0; i < b->n; i++) {
        const double alike = b->alike[i], seen = 1.0 - b->hidden[i];
        loss -= log(b->evidence[i]);
        hidden += b->hidden[i];
        b->seen[order[i]] = seen;
        b->worth[order[i]] = (1.0 - alike) / (1.0 + alike);
        if (i == 0 || after[i] >= NEIGHBOURS_S) continue;
        const double now = b->error[i] * b->scale[i], before = b->error[i - 1] * b->scale[i];
        const double product = now * before, square = now * now + before * before;
        const double far2 = (square - 2.0 * alike * product) / (1.0 - alike * alike);
        const double both = seen * (1.0 - b->hidden[i - 1])
                          * (DEGREES + 2.0) / (DEGREES + far2);     /* of a Student-t of pairs */
        products += both * product;
        squares += 0.5 * both * square;
    }
    const double per_noise2 = 1.0 / (b->errors[NOISE_M] * b->errors[NOISE_M]);
    for (Py_ssize_t r = 0; r < b->n; r++) {
        const double weight = b->seen[r] * (DEGREES + 1.0) / (DEGREES + b->square[r]);
        weighted += weight * b->square[r];
        b->worth[r] *= weight * per_noise2;
    }
    out[LOSS] += loss;
    out[HIDDEN] += hidden;
    out[SQUARE] += weighted;
    out[PRODUCT] += products;
    out[PAIR_SQUARE] += squares;
}

/* The mean of every cell's readings, each weighted by what it is worth. */
FAST static void average(const Readings *z, const Block *b, double *information, double *mean)
{
    static const int varying[] = {EAST, NORTH, COSINE, SINE, GROWTH, CLOCK,
                                  TURN, TURN + 1, TURN + 2, TURN + 3, RESIDUAL};
    for (Py_ssize_t c = b->first_cell; c < b->first_cell + b->n_cells; c++) {
        const Py_ssize_t start = z->first_row[c] - b->first, stop = z->first_row[c + 1] - b->first;
        const double *restrict worth = b->worth;
        double total = 0.0, *out = mean + c * COLUMNS;
        for (Py_ssize_t r = start; r < stop; r++) total += worth[r];
        information[c] = total = larger(total, LEAST_INFORMATION);
        out[DELAY] = out[BIAS] = out[TAG_BIAS] = 1.0;
        for (size_t k = 0; k < sizeof varying / sizeof varying[0]; k++) {
            const double *restrict values = b->column[varying[k]];
            double sum = 0.0;
            for (Py_ssize_t r = start; r < stop; r++) sum += worth[r] * values[r];
            out[varying[k]] = sum / total;
        }
    }
}

/* Keep the first of the readings that were taken nearest to the place. */
static void keep_nearest(const Block *b, double *least, int64_t *nearest)
{
    for (Py_ssize_t r = 0; r < b->n; r++) {
        if (b->flat[r] < *least) {
            *least = b->flat[r];
            *nearest = b->first + r;
        }
    }
}

static void average_all(const Readings *z, Block *b)
{
    double least[2] = {INFINITY, INFINITY};
    for (Py_ssize_t k = 0; k < z->n_blocks; k++) {
        const int64_t cone = z->cone[k];
        if (k && cone != z->cone[k - 1]) least[0] = least[1] = INFINITY;
        b->first_cell = z->first_cell[k];
        b->n_cells = z->first_cell[k + 1] - b->first_cell;
        b->first = z->first_row[b->first_cell];
        b->n = z->first_row[z->first_cell[k + 1]] - b->first;
        b->errors = z->errors + k * ERRORS;
        connect(z, b);
        for (int side = 0; side < 2; side++) {
            const Py_ssize_t cells = side * z->n_cells, at = side * z->n_cones + cone;
            b->own = z->own + (side * z->n_blocks + k) * OWN;
            look(z, b);
            take_out(z, b, z->slow + cells, z->variance + cells);
            compare(z, b);
            smooth(b);
            tally(z, b, z->tally + at * TALLIES);
            average(z, b, z->information + cells, z->mean + cells * COLUMNS);
            keep_nearest(b, &least[side], z->nearest + at);
        }
    }
}

/* Columns for the longest block; free them by `column[0]`. */
static int allocate(Block *b, Py_ssize_t longest)
{
    double *block = calloc((size_t)longest + 1, WORK_COLUMNS * sizeof(double));
    if (!block) return 0;
    double **others[] = {&b->flat, &b->left, &b->inverse, &b->square, &b->seen, &b->worth,
                         &b->same, &b->alike, &b->sharper, &b->scale, &b->visible,
                         &b->still_visible, &b->new_hidden, &b->still_hidden, &b->evidence,
                         &b->after_hidden, &b->after_visible, &b->hidden, &b->error};
    for (int k = 0; k < COLUMNS; k++) b->column[k] = block + k * longest;
    for (int k = 0; k < WORK_COLUMNS - COLUMNS; k++)
        *others[k] = block + (COLUMNS + k) * longest;
    b->error += 1;                                      /* the last: a 0 comes before the first */
    return 1;
}

/* Whether bounds begin with 0, end with `stop` and never fall; each part has a row at least. */
static int divides(const int64_t *bound, Py_ssize_t parts, Py_ssize_t stop)
{
    if (bound[0] != 0 || bound[parts] != stop) return 0;
    for (Py_ssize_t k = 0; k < parts; k++)
        if (bound[k + 1] <= bound[k]) return 0;
    return 1;
}

/* Return the length of the longest block, or -1 where an index leads out of its array. */
static Py_ssize_t check(const Readings *z)
{
    Py_ssize_t longest = 0;
    if (!divides(z->first_row, z->n_cells, z->n_readings)) return -1;
    if (!divides(z->first_cell, z->n_blocks, z->n_cells)) return -1;
    for (Py_ssize_t k = 0; k < z->n_blocks; k++) {
        const Py_ssize_t first = z->first_row[z->first_cell[k]];
        const Py_ssize_t n = z->first_row[z->first_cell[k + 1]] - first;
        if (z->cone[k] < 0 || z->cone[k] >= z->n_cones) return -1;
        if (k && z->cone[k] < z->cone[k - 1]) return -1;
        for (Py_ssize_t i = first; i < first + n; i++)
            if (z->order[i] < 0 || z->order[i] >= n) return -1;
        if (n > longest) longest = n;
    }
    return longest;
}

static PyObject *average_readings(PyObject *module, PyObject *args)
{
    enum { BUFFERS = 17 };
    Py_buffer p[BUFFERS];
    (void)module;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*y*y*y*y*y*y*y*w*w*w*w*", &p[0], &p[1], &p[2], &p[3],
                          &p[4], &p[5], &p[6], &p[7], &p[8], &p[9], &p[10], &p[11], &p[12], &p[13],
                          &p[14], &p[15], &p[16]))
        return NULL;
    const Py_ssize_t cell = sizeof(double);
    const Py_ssize_t readings = p[2].len / cell, cells = p[6].len / cell - 1;
    const Py_ssize_t blocks = p[7].len / cell - 1, cones = p[16].len / cell / 2;
    const Py_ssize_t sizes[BUFFERS] = {
        2 * readings, 2 * readings, readings, readings, readings, readings, cells + 1, blocks + 1,
        blocks, 2 * blocks * OWN, blocks * ERRORS, 2 * cells, 2 * cells, 2 * cells,
        2 * cells * COLUMNS, 2 * cones * TALLIES, 2 * cones};
    int fits = cells >= 0 && blocks >= 0;
    for (int k = 0; k < BUFFERS; k++) fits &= p[k].len == sizes[k] * cell;
    const Readings z = {
        readings, cells, blocks, cones, p[0].buf, p[1].buf, p[2].buf, p[3].buf, p[4].buf, p[5].buf,
        p[6].buf, p[7].buf, p[8].buf, p[9].buf, p[10].buf, p[11].buf, p[12].buf, p[13].buf,
        p[14].buf, p[15].buf, p[16].buf};
    const Py_ssize_t longest = fits ? check(&z) : -1;
    Block block;
    const int ready = longest >= 0 && allocate(&block, longest);
    if (ready) {
        Py_BEGIN_ALLOW_THREADS
        average_all(&z, &block);
        Py_END_ALLOW_THREADS
        free(block.column[0]);
    } else if (longest >= 0) {
        PyErr_NoMemory();
    } else {
        PyErr_SetString(PyExc_ValueError, "sizes or indices do not fit each other");
    }
    for (int k = 0; k < BUFFERS; k++) PyBuffer_Release(&p[k]);
    if (!ready) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"average_readings", average_readings, METH_VARARGS, "Fill the last four; see range_model.py."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "gaia_uwb.locate._readings", "The estimator's inner loop.", -1, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__readings(void) { return PyModule_Create(&definition); }
