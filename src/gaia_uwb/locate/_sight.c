/* Line of sight comes and goes in stretches: a hidden Markov chain of two states for each cone in
 * each drive, solved by the forward-backward recursions. See line_of_sight.py. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>

typedef struct {
    /* Log densities of a reading: visible or hidden, as the first of its kind or after another. */
    const double *visible, *still_visible, *newly_hidden, *still_hidden;
    const double *share, *same;                           /* see line_of_sight.py */
    double *hidden, *evidence, *after_hidden, *after_visible;
} Chains;

/* From r - 1 to r the state is kept with probability same[r], and otherwise drawn anew: hidden with
 * probability share[r]. A chain begins where same[r] is 0. Two reused columns keep how likely the
 * reading before was hidden if this one is hidden, or visible. */
static void solve_chains(const Chains *c, Py_ssize_t n)
{
    double out = 0.0;                                 /* the reading before was hidden */
    for (Py_ssize_t r = 0; r < n; r++) {
        const double anew = 1.0 - c->same[r], in = 1.0 - out;
        const double most = fmax(fmax(c->visible[r], c->still_visible[r]),
                                 fmax(c->newly_hidden[r], c->still_hidden[r]));
        const double visible = anew * (1.0 - c->share[r]) * exp(c->visible[r] - most);
        const double hidden = anew * c->share[r] * exp(c->newly_hidden[r] - most);
        const double out_out = out * (c->same[r] * exp(c->still_hidden[r] - most) + hidden);
        const double in_in = in * (c->same[r] * exp(c->still_visible[r] - most) + visible);
        const double in_out = in * hidden, out_in = out * visible;
        const double is_out = out_out + in_out, is_in = out_in + in_in;
        c->after_hidden[r] = out_out / fmax(is_out, 1e-300);
        c->after_visible[r] = out_in / fmax(is_in, 1e-300);
        c->hidden[r] = out = is_out / (is_out + is_in);
        c->evidence[r] = most + log(is_out + is_in);
    }
    for (Py_ssize_t r = n - 2; r >= 0; r--) {
        if (c->same[r + 1] <= 0.0) continue;
        const double next = c->hidden[r + 1];
        c->hidden[r] = next * c->after_hidden[r + 1] + (1.0 - next) * c->after_visible[r + 1];
    }
}

static PyObject *smooth(PyObject *module, PyObject *args)
{
    Py_buffer b[10];
    (void)module;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*w*w*w*w*", &b[0], &b[1], &b[2], &b[3], &b[4], &b[5],
                          &b[6], &b[7], &b[8], &b[9]))
        return NULL;
    int fits = 1;
    for (int k = 1; k < 10; k++) fits &= b[k].len == b[0].len;
    if (fits) {
        const Chains chains = {b[0].buf, b[1].buf, b[2].buf, b[3].buf, b[4].buf,
                               b[5].buf, b[6].buf, b[7].buf, b[8].buf, b[9].buf};
        Py_BEGIN_ALLOW_THREADS
        solve_chains(&chains, b[0].len / (Py_ssize_t)sizeof(double));
        Py_END_ALLOW_THREADS
    } else {
        PyErr_SetString(PyExc_ValueError, "all columns must have the same length");
    }
    for (int k = 0; k < 10; k++) PyBuffer_Release(&b[k]);
    if (!fits) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"smooth", smooth, METH_VARARGS, "Solve chains in place; see line_of_sight.py."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "gaia_uwb.locate._sight", "Chains of lines of sight.", -1, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__sight(void) { return PyModule_Create(&definition); }
