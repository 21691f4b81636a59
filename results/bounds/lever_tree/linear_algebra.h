/* Linear algebra for small symmetric matrices, and random numbers. Double precision. */
#ifndef LINEAR_ALGEBRA_H
#define LINEAR_ALGEBRA_H
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double now() {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}
/* Uniform random number in [0, 1), by xorshift, and a normal one. */
static unsigned long long random_state = 88172645463325252ULL;
static double uniform() {
  random_state ^= random_state << 13;
  random_state ^= random_state >> 7;
  random_state ^= random_state << 17;
  return (random_state >> 11) * (1.0 / 9007199254740992.0);
}

static double normal_number() {
  double u = uniform() + 1e-300, v = uniform();
  return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}

/* Eigenvalues w and eigenvectors (columns of v) of a symmetric n × n matrix a, by Jacobi. a is overwritten. */
static void eigen(int n, double *a, double *w, double *v) {
  if (v) {
    for (int i = 0; i < n * n; i++)
      v[i] = 0;
    for (int i = 0; i < n; i++)
      v[i * n + i] = 1;
  }
  for (int s = 0; s < 30; s++) {
    double off = 0, dg = 0;
    for (int i = 0; i < n; i++) {
      dg += a[i * n + i] * a[i * n + i];
      for (int j = 0; j < i; j++)
        off += a[i * n + j] * a[i * n + j];
    }
    if (off < 1e-26 * (dg + 1e-300))
      break;
    for (int p = 0; p < n; p++)
      for (int q = p + 1; q < n; q++) {
        double x = a[p * n + q];
        if (fabs(x) < 1e-300)
          continue;
        double th = (a[q * n + q] - a[p * n + p]) / (2 * x);
        double t = (th >= 0 ? 1 : -1) / (fabs(th) + sqrt(th * th + 1));
        double c = 1 / sqrt(t * t + 1), sn = t * c;
        for (int k = 0; k < n; k++) {
          double u = a[k * n + p], w2 = a[k * n + q];
          a[k * n + p] = c * u - sn * w2;
          a[k * n + q] = sn * u + c * w2;
        }
        for (int k = 0; k < n; k++) {
          double u = a[p * n + k], w2 = a[q * n + k];
          a[p * n + k] = c * u - sn * w2;
          a[q * n + k] = sn * u + c * w2;
        }
        if (v)
          for (int k = 0; k < n; k++) {
            double u = v[k * n + p], w2 = v[k * n + q];
            v[k * n + p] = c * u - sn * w2;
            v[k * n + q] = sn * u + c * w2;
          }
      }
  }
  for (int i = 0; i < n; i++)
    w[i] = a[i * n + i];
}

/* Least eigenvalue of a symmetric n × n matrix (n ≤ 10, row length st): tridiagonal form, then
   Laguerre steps from a lower bound. They grow towards the least root and never pass it. */
static double least_eigenvalue(int n, const double *a0, int st) {
  double a[100];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      a[i * n + j] = a0[i * st + j];
  double dd[10], e2[10];
  for (int k = 0; k < n - 2; k++) {
    double s = 0;
    for (int i = k + 1; i < n; i++)
      s += a[i * n + k] * a[i * n + k];
    double tail = s - a[(k + 1) * n + k] * a[(k + 1) * n + k];
    if (tail < 1e-30 * s || s < 1e-300) {
      e2[k] = a[(k + 1) * n + k] * a[(k + 1) * n + k];
      continue;
    }
    double al = a[(k + 1) * n + k] > 0 ? -sqrt(s) : sqrt(s);
    double v[10] = {0};
    for (int i = k + 1; i < n; i++)
      v[i] = a[i * n + k];
    v[k + 1] -= al;
    double vv = 0;
    for (int i = k + 1; i < n; i++)
      vv += v[i] * v[i];
    double b = 2 / vv;
    double p[10];
    for (int i = k + 1; i < n; i++) {
      double t = 0;
      for (int j = k + 1; j < n; j++)
        t += a[i * n + j] * v[j];
      p[i] = b * t;
    }
    double K = 0;
    for (int i = k + 1; i < n; i++)
      K += p[i] * v[i];
    K *= b / 2;
    for (int i = k + 1; i < n; i++)
      p[i] -= K * v[i];
    for (int i = k + 1; i < n; i++)
      for (int j = k + 1; j < n; j++)
        a[i * n + j] -= v[i] * p[j] + p[i] * v[j];
    e2[k] = al * al;
  }
  for (int i = 0; i < n; i++)
    dd[i] = a[i * n + i];
  e2[n - 2] = a[(n - 1) * n + n - 2] * a[(n - 1) * n + n - 2];
  // Gershgorin lower start then Newton/Laguerre on char poly from below (monotone)
  double x = 1e300;
  for (int i = 0; i < n; i++) {
    double r = (i ? sqrt(e2[i - 1]) : 0) + (i < n - 1 ? sqrt(e2[i]) : 0);
    if (dd[i] - r < x)
      x = dd[i] - r;
  }
  x -= 1e-12;
  for (int it = 0; it < 60; it++) {
    // sum 1/(lambda_i - x) = -p'/p via recurrence
    double p0 = 1, p1 = dd[0] - x, q0 = 0, q1 = -1, r0 = 0, r1 = 0;
    for (int i = 1; i < n; i++) {
      double p = (dd[i] - x) * p1 - e2[i - 1] * p0, q = (dd[i] - x) * q1 - p1 - e2[i - 1] * q0,
             r = (dd[i] - x) * r1 - 2 * q1 - e2[i - 1] * r0;
      p0 = p1;
      p1 = p;
      q0 = q1;
      q1 = q;
      r0 = r1;
      r1 = r;
    }
    if (p1 <= 0)
      break;
    double g = -q1 / p1;        /*sum 1/(l-x)*/
    double h = g * g - r1 / p1; /* sum 1/(l-x)^2 */
    double disc = (n - 1) * (n * h - g * g);
    if (disc < 0)
      disc = 0;
    double step = n / (g + sqrt(disc));
    x += step;
    if (step < 1e-10 * (1e-3 + fabs(x)))
      break;
  }
  return x;
}

/* Cholesky factor in the lower triangle of a; 0 if a is not positive definite. */
static int cholesky(int n, double *a, int st) {
  for (int j = 0; j < n; j++) {
    double s = a[j * st + j];
    for (int k = 0; k < j; k++)
      s -= a[j * st + k] * a[j * st + k];
    if (s <= 0)
      return 0;
    s = sqrt(s);
    a[j * st + j] = s;
    double is = 1 / s;
    for (int i = j + 1; i < n; i++) {
      double t = a[i * st + j];
      for (int k = 0; k < j; k++)
        t -= a[i * st + k] * a[j * st + k];
      a[i * st + j] = t * is;
    }
  }
  return 1;
}

/* Inverse of the matrix whose Cholesky factor is l. */
static void inverse_from_cholesky(int n, const double *l, int st, double *o) { // o = (LL^T)^-1
  double li[100];
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++)
      li[i * n + j] = 0;
    li[i * n + i] = 1 / l[i * st + i];
    for (int j = 0; j < i; j++) {
      double s = 0;
      for (int k = j; k < i; k++)
        s -= l[i * st + k] * li[k * n + j];
      li[i * n + j] = s * li[i * n + i];
    }
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      double s = 0;
      for (int k = i; k < n; k++)
        s += li[k * n + i] * li[k * n + j];
      o[i * n + j] = o[j * n + i] = s;
    }
}

/* Inverse square root of a symmetric n × n matrix, n ≤ 4. */
static void inverse_root(int n, const double *S, double *o) {
  double a[16], w[4], v[16];
  memcpy(a, S, n * n * sizeof(double));
  eigen(n, a, w, v);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double s = 0;
      for (int k = 0; k < n; k++)
        s += v[i * n + k] * v[j * n + k] / sqrt(w[k]);
      o[i * n + j] = s;
    }
}

#endif
