/* Inverses and determinants of many small covariance matrices at once. General routines, which seek
 * pivots and are called for each matrix, need much longer; see slow_errors.py. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <math.h>
#include <stdlib.h>

/* One source, the widest vector unit that the machine has at run time. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define FAST __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FAST
#endif

/* Put the inverse of a symmetric matrix in its place; return the logarithm of its determinant, or
 * NaN where it is not positive definite.
 *
 * Sweeping out column k takes from every other entry what the pivot explains of it; when all are
 * swept out, what is left is the inverse with the other sign. No pivot need be sought: every one is
 * a conditional variance. Only the lower triangle is worked on. */
FAST static double invert_one(double *restrict a, double *restrict column, Py_ssize_t n)
{
    double log_determinant = 0.0;
    for (Py_ssize_t k = 0; k < n; k++) {
        for (Py_ssize_t i = 0; i < k; i++) column[i] = a[k * n + i];
        for (Py_ssize_t i = k; i < n; i++) column[i] = a[i * n + k];
        const double pivot = column[k];
        if (!(pivot > 0.0)) return NAN;
        log_determinant += log(pivot);
        for (Py_ssize_t i = 0; i < n; i++) {
            const double factor = column[i] / pivot;
            double *restrict row = a + i * n;
            for (Py_ssize_t j = 0; j <= i; j++) row[j] -= factor * column[j];
        }
        for (Py_ssize_t i = 0; i < k; i++) a[k * n + i] = column[i] / pivot;
        for (Py_ssize_t i = k + 1; i < n; i++) a[i * n + k] = column[i] / pivot;
        a[k * n + k] = -1.0 / pivot;
    }
    for (Py_ssize_t i = 0; i < n; i++)
        for (Py_ssize_t j = 0; j <= i; j++) a[j * n + i] = a[i * n + j] = -a[i * n + j];
    return log_determinant;
}

static PyObject *invert(PyObject *module, PyObject *args)
{
    Py_buffer matrices, log_determinants;
    Py_ssize_t n;
    (void)module;
    if (!PyArg_ParseTuple(args, "w*w*n", &matrices, &log_determinants, &n)) return NULL;
    const Py_ssize_t count = log_determinants.len / (Py_ssize_t)sizeof(double);
    const int fits = n > 0 && log_determinants.len % (Py_ssize_t)sizeof(double) == 0
                  && matrices.len / n / n == log_determinants.len
                  && matrices.len == log_determinants.len * n * n;
    double *column = fits ? malloc((size_t)n * sizeof(double)) : NULL;
    int positive = 1;
    if (column) {
        double *matrix = matrices.buf, *log_determinant = log_determinants.buf;
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t k = 0; k < count && positive; k++) {
            log_determinant[k] = invert_one(matrix + k * n * n, column, n);
            positive = !isnan(log_determinant[k]);
        }
        Py_END_ALLOW_THREADS
        free(column);
        if (!positive) PyErr_SetString(PyExc_ValueError, "a covariance is not positive definite");
    } else if (fits) {
        PyErr_NoMemory();
    } else {
        PyErr_SetString(PyExc_ValueError, "sizes do not fit each other");
    }
    PyBuffer_Release(&matrices);
    PyBuffer_Release(&log_determinants);
    if (!column || !positive) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"invert", invert, METH_VARARGS, "Invert matrices in place; see slow_errors.py."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "gaia_uwb.locate._covariances", "Inverses of small covariances.", -1,
    methods, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__covariances(void) { return PyModule_Create(&definition); }
