/* A short closed tour through points of the plane: the inner loop of tour.py.

   Grown by farthest insertion, then shortened by 2-opt exchanges and moves of single points until
   neither helps. A tour is an array of rows; n is the number of points, k that of points in it. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <math.h>
#include <stdint.h>
#include <string.h>

typedef struct {
    const double *point; /* (n, 2) */
    int64_t *tour;       /* (n,) */
    double *gap;         /* (n,): work space */
    Py_ssize_t n;
    double least_gain; /* a change must gain more than rounding, or it goes round in circles */
} Work;

static double distance(const Work *w, int64_t a, int64_t b)
{
    double x = w->point[2 * a] - w->point[2 * b], y = w->point[2 * a + 1] - w->point[2 * b + 1];
    return sqrt(x * x + y * y);
}

static double tour_length(const Work *w)
{
    double sum = distance(w, w->tour[w->n - 1], w->tour[0]);
    for (Py_ssize_t i = 1; i < w->n; i++) sum += distance(w, w->tour[i - 1], w->tour[i]);
    return sum;
}

/* After which of k places a point lengthens the tour least, and by how much. */
static Py_ssize_t best_place(const Work *w, Py_ssize_t k, int64_t point, double *detour)
{
    Py_ssize_t best = 0;
    *detour = INFINITY;
    double first = distance(w, w->tour[0], point), here = first;
    for (Py_ssize_t i = 0; i < k; i++) {
        double next = i + 1 < k ? distance(w, w->tour[i + 1], point) : first;
        double edge = distance(w, w->tour[i], w->tour[i + 1 < k ? i + 1 : 0]);
        if (here + next - edge < *detour) {
            *detour = here + next - edge;
            best = i;
        }
        here = next;
    }
    return best;
}

static void insert(Work *w, Py_ssize_t k, Py_ssize_t after, int64_t point)
{
    memmove(w->tour + after + 2, w->tour + after + 1, (k - after - 1) * sizeof(int64_t));
    w->tour[after + 1] = point;
}

/* The point farthest from those of the tour comes next. */
static void insert_farthest_first(Work *w, Py_ssize_t k)
{
    for (Py_ssize_t p = 0; p < w->n; p++) {
        w->gap[p] = INFINITY;
        for (Py_ssize_t i = 0; i < k; i++) w->gap[p] = fmin(w->gap[p], distance(w, p, w->tour[i]));
    }
    for (Py_ssize_t i = 0; i < k; i++) w->gap[w->tour[i]] = -1.0;
    for (; k < w->n; k++) {
        int64_t farthest = 0;
        for (Py_ssize_t p = 1; p < w->n; p++)
            if (w->gap[p] > w->gap[farthest]) farthest = p;
        double detour;
        insert(w, k, best_place(w, k, farthest, &detour), farthest);
        for (Py_ssize_t p = 0; p < w->n; p++)
            w->gap[p] = fmin(w->gap[p], distance(w, p, farthest));
        w->gap[farthest] = -1.0;
    }
}

/* One sweep of 2-opt: each edge is exchanged with its best partner. */
static void exchange_edges(Work *w)
{
    const Py_ssize_t n = w->n;
    int64_t *tour = w->tour;
    for (Py_ssize_t k = 0; k + 2 < n; k++) {
        double most = -INFINITY, edge = distance(w, tour[k], tour[k + 1]);
        Py_ssize_t other = k + 1;
        for (Py_ssize_t j = k + 1; j < n; j++) {
            int64_t following = tour[j + 1 < n ? j + 1 : 0];
            double gain = edge + distance(w, tour[j], following) - distance(w, tour[j], tour[k])
                        - distance(w, following, tour[k + 1]);
            if (gain > most) {
                most = gain;
                other = j;
            }
        }
        if (most <= w->least_gain) continue;
        for (Py_ssize_t a = k + 1, b = other; a < b; a++, b--) {
            int64_t swapped = tour[a];
            tour[a] = tour[b];
            tour[b] = swapped;
        }
    }
}

/* Each point in turn goes to where the tour gets shortest. */
static void move_single_points(Work *w)
{
    const Py_ssize_t n = w->n;
    int64_t *tour = w->tour;
    for (int64_t point = 0; n > 3 && point < n; point++) {
        Py_ssize_t k = 0;
        while (tour[k] != point) k++;
        int64_t before = tour[k ? k - 1 : n - 1], after = tour[k + 1 < n ? k + 1 : 0];
        double saved = distance(w, point, before) + distance(w, after, point)
                     - distance(w, after, before);
        memmove(tour + k, tour + k + 1, (n - 1 - k) * sizeof(int64_t));
        double cost;
        Py_ssize_t best = best_place(w, n - 1, point, &cost);
        insert(w, n - 1, saved - cost > w->least_gain ? best : k - 1, point);
    }
}

static PyObject *short_tour(PyObject *module, PyObject *args)
{
    Py_buffer point, gap, tour;
    Py_ssize_t started;
    (void)module;
    if (!PyArg_ParseTuple(args, "y*w*w*n", &point, &gap, &tour, &started)) return NULL;
    Work w = {point.buf, tour.buf, gap.buf, tour.len / (Py_ssize_t)sizeof(int64_t), 0.0};
    int fits = point.len == w.n * 2 * (Py_ssize_t)sizeof(double) && gap.len * 2 == point.len
            && started >= 1 && started <= w.n;
    for (Py_ssize_t p = 0; fits && p < w.n; p++) w.gap[p] = 0.0;
    for (Py_ssize_t i = 0; fits && i < started; i++) { /* every row once */
        fits = w.tour[i] >= 0 && w.tour[i] < w.n && w.gap[w.tour[i]]++ == 0.0;
    }
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t p = 0; p < w.n; p++)
            w.least_gain = fmax(w.least_gain, 1e-12 * distance(&w, p, 0));
        insert_farthest_first(&w, started);
        double shorter = tour_length(&w), length = INFINITY;
        while (shorter < length) {
            length = shorter;
            exchange_edges(&w);
            move_single_points(&w);
            shorter = tour_length(&w);
        }
        Py_END_ALLOW_THREADS
    } else {
        PyErr_SetString(PyExc_ValueError, "expected different rows of the points to start with");
    }
    PyBuffer_Release(&point);
    PyBuffer_Release(&gap);
    PyBuffer_Release(&tour);
    if (!fits) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"short_tour", short_tour, METH_VARARGS, "Complete a tour in place; see tour.py."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "gaia_uwb.zone._tour", "The inner loop of short tours.", -1, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__tour(void)
{
    return PyModule_Create(&definition);
}
