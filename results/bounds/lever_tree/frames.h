/* Tight frames as subspaces, their charts and their tangent spaces.

   W̄ (3 × 7) and F (4 × 7) together are orthogonal; W = √(7/3) W̄. W is a unit tight frame if |w̄_i|² = 3/7
   for all i. A neighbour is W̄ + K F, made orthonormal, for a 3 × 4 matrix K; F becomes F − KᵀW̄, made
   orthonormal. K is tangent if w̄_iᵀ K f_i = 0 for all i: 7 equations of rank 6, so 6 dimensions are left.
   The same 6 dimensions hold V: VFᵀ fulfils the same equations, v_i·ω_i = 0.
   A 3 × 4 matrix is an array of 12 numbers, row by row. */
#ifndef FRAMES_H
#define FRAMES_H
#include "linear_algebra.h"

/* B: orthonormal tangent directions. C: orthonormal normal directions. The equations are
   a_i·K = Σ_m U_mi sg_m (C_m·K). */
typedef struct {
  double B[6][12], C[6][12], U[6][7], sg[6];
} Tangent;
/* Tangent and normal directions at (W̄, F). */
static int tangent(const double *W, const double *F, Tangent *g) {
  double M[49], w[7], v[49], a[7][12];
  for (int i = 0; i < 7; i++)
    for (int r = 0; r < 3; r++)
      for (int c = 0; c < 4; c++)
        a[i][r * 4 + c] = W[r * 7 + i] * F[c * 7 + i];
  for (int i = 0; i < 7; i++)
    for (int j = 0; j < 7; j++) {
      double s = 0;
      for (int k = 0; k < 12; k++)
        s += a[i][k] * a[j][k];
      M[i * 7 + j] = s;
    }
  eigen(7, M, w, v);
  int mn = 0;
  for (int i = 1; i < 7; i++)
    if (w[i] < w[mn])
      mn = i;
  int m = 0;
  for (int i = 0; i < 7; i++)
    if (i != mn) {
      g->sg[m] = sqrt(w[i] > 1e-14 ? w[i] : 1e-14);
      for (int j = 0; j < 7; j++)
        g->U[m][j] = v[j * 7 + i];
      for (int k = 0; k < 12; k++) {
        double s = 0;
        for (int j = 0; j < 7; j++)
          s += a[j][k] * g->U[m][j];
        g->C[m][k] = s / g->sg[m];
      }
      m++;
    }
  // complement
  double P[12][12];
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < 12; j++) {
      double s = i == j;
      for (int k = 0; k < 6; k++)
        s -= g->C[k][i] * g->C[k][j];
      P[i][j] = s;
    }
  for (int k = 0; k < 6; k++) {
    int b = 0;
    double bv = -1;
    for (int i = 0; i < 12; i++)
      if (P[i][i] > bv) {
        bv = P[i][i];
        b = i;
      }
    double s = sqrt(P[b][b]);
    for (int j = 0; j < 12; j++)
      g->B[k][j] = P[b][j] / s;
    for (int i = 0; i < 12; i++)
      for (int j = 0; j < 12; j++)
        P[i][j] -= g->B[k][i] * g->B[k][j];
  }
  return 1;
}

/* All K f_i (7 × 3), and all Kᵀ w̄_i (7 × 4). */
static void times_f(const double *V, const double *F, double *o) {
  for (int i = 0; i < 7; i++)
    for (int r = 0; r < 3; r++) {
      double s = 0;
      for (int c = 0; c < 4; c++)
        s += V[r * 4 + c] * F[c * 7 + i];
      o[i * 3 + r] = s;
    }
}
static void transposed_times_w(const double *V, const double *W, double *o) {
  for (int i = 0; i < 7; i++)
    for (int c = 0; c < 4; c++) {
      double s = 0;
      for (int r = 0; r < 3; r++)
        s += V[r * 4 + c] * W[r * 7 + i];
      o[i * 4 + c] = s;
    }
}

/* Neighbour (W2, F2) of (W, F) with the coordinates K; si and ri are (I + KKᵀ)^-1/2 and (I + KᵀK)^-1/2. */
static void moved(const double *W, const double *F, const double *K, double *W2, double *F2, double *si,
                  double *ri) {
  double S[9], R[16], wt[21], ft[28];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      double s = i == j;
      for (int k = 0; k < 4; k++)
        s += K[i * 4 + k] * K[j * 4 + k];
      S[i * 3 + j] = s;
    }
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) {
      double s = i == j;
      for (int k = 0; k < 3; k++)
        s += K[k * 4 + i] * K[k * 4 + j];
      R[i * 4 + j] = s;
    }
  inverse_root(3, S, si);
  inverse_root(4, R, ri);
  for (int r = 0; r < 3; r++)
    for (int i = 0; i < 7; i++) {
      double s = W[r * 7 + i];
      for (int c = 0; c < 4; c++)
        s += K[r * 4 + c] * F[c * 7 + i];
      wt[r * 7 + i] = s;
    }
  for (int c = 0; c < 4; c++)
    for (int i = 0; i < 7; i++) {
      double s = F[c * 7 + i];
      for (int r = 0; r < 3; r++)
        s -= K[r * 4 + c] * W[r * 7 + i];
      ft[c * 7 + i] = s;
    }
  for (int r = 0; r < 3; r++)
    for (int i = 0; i < 7; i++) {
      double s = 0;
      for (int k = 0; k < 3; k++)
        s += si[r * 3 + k] * wt[k * 7 + i];
      W2[r * 7 + i] = s;
    }
  for (int r = 0; r < 4; r++)
    for (int i = 0; i < 7; i++) {
      double s = 0;
      for (int k = 0; k < 4; k++)
        s += ri[r * 4 + k] * ft[k * 7 + i];
      F2[r * 7 + i] = s;
    }
}

/* Newton's method from K along the normals to the nearest tight frame. */
static int project(const double *W, const double *F, double *K, double *W2, double *F2, double *si,
                   double *ri) {
  Tangent g;
  tangent(W, F, &g);
  for (int it = 0; it < 30; it++) {
    moved(W, F, K, W2, F2, si, ri);
    double r[7], mx = 0;
    for (int i = 0; i < 7; i++) {
      double s = -3. / 7;
      for (int k = 0; k < 3; k++)
        s += W2[k * 7 + i] * W2[k * 7 + i];
      r[i] = s / 2;
      if (fabs(s) > mx)
        mx = fabs(s);
    }
    if (mx < 1e-13)
      return 1;
    for (int m = 0; m < 6; m++) {
      double s = 0;
      for (int i = 0; i < 7; i++)
        s += g.U[m][i] * r[i];
      s /= g.sg[m];
      for (int k = 0; k < 12; k++)
        K[k] -= s * g.C[m][k];
    }
  }
  return 0;
}

/* Random tight frame; returns its weight, so that weighted means are means over the volume. */
static double sample(double *W, double *F) {
  for (;;) {
    double w[21];
    for (int i = 0; i < 7; i++) {
      double n = 0;
      for (int r = 0; r < 3; r++) {
        w[r * 7 + i] = normal_number();
        n += w[r * 7 + i] * w[r * 7 + i];
      }
      n = 1 / sqrt(n);
      for (int r = 0; r < 3; r++)
        w[r * 7 + i] *= n;
    }
    double S[9], e = 0;
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++) {
        double s = 0;
        for (int i = 0; i < 7; i++)
          s += w[a * 7 + i] * w[b * 7 + i];
        S[a * 3 + b] = s;
        s -= (a == b) * 7. / 3;
        e += s * s;
      }
    if (e > 0.5 * 0.5)
      continue;
    // to tight frame: alternate
    int ok = 0;
    for (int it = 0; it < 500; it++) {
      double si[9];
      inverse_root(3, S, si);
      double u[21];
      for (int a = 0; a < 3; a++)
        for (int i = 0; i < 7; i++) {
          double s = 0;
          for (int b = 0; b < 3; b++)
            s += si[a * 3 + b] * w[b * 7 + i];
          u[a * 7 + i] = s;
        }
      double mx = 0;
      for (int i = 0; i < 7; i++) {
        double n = 0;
        for (int r = 0; r < 3; r++)
          n += u[r * 7 + i] * u[r * 7 + i];
        if (fabs(n - 3. / 7) > mx)
          mx = fabs(n - 3. / 7);
        n = 1 / sqrt(n);
        for (int r = 0; r < 3; r++)
          w[r * 7 + i] = u[r * 7 + i] * n;
      }
      for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
          double s = 0;
          for (int i = 0; i < 7; i++)
            s += w[a * 7 + i] * w[b * 7 + i];
          S[a * 3 + b] = s;
        }
      if (mx < 1e-13) {
        memcpy(W, u, sizeof u);
        ok = 1;
        break;
      }
    }
    if (!ok)
      continue;
    // F: complement
    double P[7][7];
    for (int i = 0; i < 7; i++)
      for (int j = 0; j < 7; j++) {
        double s = i == j;
        for (int r = 0; r < 3; r++)
          s -= W[r * 7 + i] * W[r * 7 + j];
        P[i][j] = s;
      }
    for (int k = 0; k < 4; k++) {
      int b = 0;
      for (int i = 1; i < 7; i++)
        if (P[i][i] > P[b][b])
          b = i;
      double s = 1 / sqrt(P[b][b]);
      for (int j = 0; j < 7; j++)
        F[k * 7 + j] = P[b][j] * s;
      for (int i = 0; i < 7; i++)
        for (int j = 0; j < 7; j++)
          P[i][j] -= F[k * 7 + i] * F[k * 7 + j];
    }
    // weight: sqrt det of DF DF^T, F: (S^2)^7 -> sym traceless 5 (orthonormal coordinates)
    double D[5][21];
    int q = 0; // direction tangent: dw_i in plane; build rows for basis matrices
    double Eb[5][9] = {{0, M_SQRT1_2, 0, M_SQRT1_2, 0, 0, 0, 0, 0},
                       {0, 0, M_SQRT1_2, 0, 0, 0, M_SQRT1_2, 0, 0},
                       {0, 0, 0, 0, 0, M_SQRT1_2, 0, M_SQRT1_2, 0},
                       {M_SQRT1_2, 0, 0, 0, -M_SQRT1_2, 0, 0, 0, 0},
                       {0.40824829046386, 0, 0, 0, 0.40824829046386, 0, 0, 0, -0.81649658092773}};
    (void)q;
    for (int z = 0; z < 5; z++)
      for (int i = 0; i < 7; i++) {
        double v[3], dt = 0;
        for (int a = 0; a < 3; a++) {
          v[a] = 0;
          for (int b = 0; b < 3; b++)
            v[a] += 2 * Eb[z][a * 3 + b] * W[b * 7 + i] * sqrt(7. / 3);
          dt += v[a] * W[a * 7 + i] * sqrt(7. / 3);
        }
        for (int a = 0; a < 3; a++)
          D[z][a * 7 + i] = v[a] - dt * W[a * 7 + i] * sqrt(7. / 3);
      }
    double N[25];
    for (int a = 0; a < 5; a++)
      for (int b = 0; b < 5; b++) {
        double s = 0;
        for (int k = 0; k < 21; k++)
          s += D[a][k] * D[b][k];
        N[a * 5 + b] = s;
      }
    if (!cholesky(5, N, 5))
      continue;
    double det = 1;
    for (int i = 0; i < 5; i++)
      det *= N[i * 6];
    // orbit volume of SO(3): sqrt det of inertia sum (|w|^2 I - w w^T) = (14/3)^{3/2} constant
    return det;
  }
}

#endif
