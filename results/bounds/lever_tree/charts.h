/* Charts of the tight frames: coordinates t_k = ⟨B_k, K⟩ around a centre, and which centre is nearest.

   Every frame is, up to an order of its columns, nearest to some centre: P = W̄ᵀW̄ has the greatest trace of
   P π(P_c) over centres c and orders π. So a chart has to cover only frames nearest to its centre. */
#ifndef CHARTS_H
#define CHARTS_H
#include "relaxation.h"

typedef struct {
  double W[21], F[28], P[49];
  Tangent g;
} Centre;
static Centre C[4000];
/* Number of centres, and the one whose chart is in use. */
static int centre_count, current;
/* Greatest |t| of a frame within the radius. */
static double greatest_t = 1e9;
/* Square of the radius: a chart has the frames with trace(P P_c) ≥ 3 − radius². */
static double radius_squared = 0.25;
/* All orders of seven columns. */
static unsigned char perm[5040][7];
static int order_count;
static void all_orders(int k, unsigned char *p, int used) {
  if (k == 7) {
    memcpy(perm[order_count++], p, 7);
    return;
  }
  for (int i = 0; i < 7; i++)
    if (!(used >> i & 1)) {
      p[k] = i;
      all_orders(k + 1, p, used | 1 << i);
    }
}

/* Projector on the rows of W̄. */
static void projector(const double *W, double *P) {
  for (int i = 0; i < 7; i++)
    for (int j = 0; j < 7; j++) {
      double s = 0;
      for (int r = 0; r < 3; r++)
        s += W[r * 7 + i] * W[r * 7 + j];
      P[i * 7 + j] = s;
    }
}

/* Greatest trace of P π(Q) over all orders π. */
static double best_overlap(const double *P, const double *Q, int *bp) {
  double b = -1;
  for (int z = 0; z < 5040; z++) {
    const unsigned char *p = perm[z];
    double s = 0;
    for (int i = 0; i < 7; i++)
      for (int j = 0; j < i; j++)
        s += P[i * 7 + j] * Q[p[i] * 7 + p[j]];
    if (s > b) {
      b = s;
      *bp = z;
    }
  }
  return 9. / 7 + 2 * b;
}

/* Other centres near the one in use: a frame that is nearest to it has ⟨N, P⟩ ≥ 0 for all of them. */
typedef struct {
  double N[21], n0;
} HalfSpace;
static HalfSpace *halves;
static int half_count, near_count;
static double centre_pairs[21];
static int by_distance(const void *a, const void *b) {
  double x = ((HalfSpace *)a)->n0, y = ((HalfSpace *)b)->n0;
  return x < y ? -1 : x > y;
}
static void neighbours(int a, int most) {
  half_count = 0;
  for (int b = 0; b < centre_count; b++)
    for (int z = 0; z < 5040; z++) {
      if (b == a && z == 0)
        continue;
      const unsigned char *q = perm[z];
      double s = 0;
      for (int i = 0; i < 7; i++)
        for (int j = 0; j < i; j++)
          s += C[a].P[i * 7 + j] * C[b].P[q[i] * 7 + q[j]];
      double ov = 9. / 7 + 2 * s;
      if (ov < 3 - 4 * radius_squared * 1.05)
        continue;
      HalfSpace *h = halves + half_count++;
      h->n0 = 0;
      for (int e = 0; e < 21; e++) {
        h->N[e] = C[a].P[PAIR_I[e] * 7 + PAIR_J[e]] - C[b].P[q[PAIR_I[e]] * 7 + q[PAIR_J[e]]];
        h->n0 += 2 * h->N[e] * h->N[e];
      }
      if (half_count >= 2000000)
        break;
    }
  qsort(halves, half_count, sizeof(HalfSpace), by_distance);
  near_count = half_count;
  if (half_count > most)
    half_count = most;
  for (int p = 0; p < 21; p++)
    centre_pairs[p] = C[a].P[PAIR_I[p] * 7 + PAIR_J[p]];
}

/* 1: another centre is nearer in all the cell. 2: the cell is beyond the radius. inside: all of it is within. */
static int elsewhere(const Cell *cell, double size2, int *inside) {
  double P[21], g[6][21];
  for (int p = 0; p < 21; p++) {
    int i = PAIR_I[p], j = PAIR_J[p];
    double s = 0;
    for (int r = 0; r < 3; r++)
      s += cell->W[r * 7 + i] * cell->W[r * 7 + j];
    P[p] = s;
  }
  for (int k = 0; k < 6; k++) {
    double kf[21];
    times_f(cell->gen[k], cell->F, kf);
    for (int p = 0; p < 21; p++) {
      int i = PAIR_I[p], j = PAIR_J[p];
      double s = 0;
      for (int r = 0; r < 3; r++)
        s += kf[i * 3 + r] * cell->W[r * 7 + j] + kf[j * 3 + r] * cell->W[r * 7 + i];
      g[k][p] = s;
    }
  }
  double rem = 2.5 * size2;
  double s0 = 9. / 7, r0 = 0;
  for (int p = 0; p < 21; p++)
    s0 += 2 * centre_pairs[p] * P[p];
  for (int k = 0; k < 6; k++) {
    double t = 0;
    for (int p = 0; p < 21; p++)
      t += 2 * centre_pairs[p] * g[k][p];
    r0 += fabs(t);
  }
  double nc2 = 0;
  for (int p = 0; p < 21; p++)
    nc2 += 2 * centre_pairs[p] * centre_pairs[p];
  // |<P2,Ptilde>| : P off-diagonal only (diagonal fixed)
  r0 += rem * sqrt(nc2);
  if (s0 + r0 < 3 - radius_squared)
    return 2;
  *inside = s0 - r0 > 3 - radius_squared;
  for (int h = 0; h < half_count; h++) {
    const HalfSpace *H = halves + h;
    double s = 0;
    for (int p = 0; p < 21; p++)
      s += H->N[p] * P[p];
    if (s > 0)
      continue;
    double up_ = 2 * s;
    for (int k = 0; k < 6; k++) {
      double t = 0;
      for (int p = 0; p < 21; p++)
        t += H->N[p] * g[k][p];
      up_ += 2 * fabs(t);
    }
    up_ += sqrt(H->n0) * rem;
    if (up_ < -1e-9)
      return 1;
  }
  return 0;
}

/* Least |t| in the cell. */
static double least_distance(const Cell *n) {
  double s = 0;
  for (int k = 0; k < 6; k++) {
    double a = fabs(n->tc[k]) - n->h[k];
    if (a > 0)
      s += a * a;
  }
  return sqrt(s);
}

/* Frame in the middle of the cell, its generators and their second order; 0 if Newton's method finds none. */
static int centre_from(Cell *n) {
  const Centre *c = C + current;
  const Tangent *ga = &c->g;
  double si[9], ri[16];
  double u[6];
  for (int m = 0; m < 6; m++) {
    double s = 0;
    for (int q = 0; q < 12; q++)
      s += n->K[q] * ga->C[m][q];
    u[m] = s;
  }
  Tangent g;
  int ok = 0;
  double CC[6][12]; // image of chart normals at P_c
  for (int it = 0; it < 25; it++) {
    for (int q = 0; q < 12; q++) {
      double s = 0;
      for (int k = 0; k < 6; k++)
        s += n->tc[k] * ga->B[k][q] + u[k] * ga->C[k][q];
      n->K[q] = s;
    }
    moved(c->W, c->F, n->K, n->W, n->F, si, ri);
    double r[7], mx = 0;
    for (int i = 0; i < 7; i++) {
      double s = -3. / 7;
      for (int k = 0; k < 3; k++)
        s += n->W[k * 7 + i] * n->W[k * 7 + i];
      r[i] = s / 2;
      if (fabs(s) > mx)
        mx = fabs(s);
    }
    tangent(n->W, n->F, &g);
    for (int m = 0; m < 6; m++) {
      const double *a = ga->C[m];
      double t[12];
      for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
          double s = 0;
          for (int q = 0; q < 3; q++)
            s += si[i * 3 + q] * a[q * 4 + j];
          t[i * 4 + j] = s;
        }
      for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
          double s = 0;
          for (int q = 0; q < 4; q++)
            s += t[i * 4 + q] * ri[q * 4 + j];
          CC[m][i * 4 + j] = s;
        }
    }
    if (mx < 1e-13) {
      ok = 1;
      break;
    }
    if (!(mx < 10))
      return 0;
    // residual in normal coordinates: A K = r -> normal coord = sg^-1 U^T r ; solve sum u_m <CC_m, C_p> = -that
    double A[6][7];
    for (int p = 0; p < 6; p++) {
      for (int m = 0; m < 6; m++) {
        double s = 0;
        for (int q = 0; q < 12; q++)
          s += g.C[p][q] * CC[m][q];
        A[p][m] = s;
      }
      double s = 0;
      for (int i = 0; i < 7; i++)
        s += g.U[p][i] * r[i];
      A[p][6] = -s / g.sg[p];
    }
    for (int p = 0; p < 6; p++) {
      int b = p;
      for (int i = p + 1; i < 6; i++)
        if (fabs(A[i][p]) > fabs(A[b][p]))
          b = i;
      for (int k = 0; k < 7; k++) {
        double t = A[p][k];
        A[p][k] = A[b][k];
        A[b][k] = t;
      }
      if (fabs(A[p][p]) < 1e-12)
        return 0;
      for (int i = 0; i < 6; i++)
        if (i != p) {
          double f = A[i][p] / A[p][p];
          for (int k = p; k < 7; k++)
            A[i][k] -= f * A[p][k];
        }
    }
    double nrm = 0;
    for (int p = 0; p < 6; p++) {
      A[p][6] /= A[p][p];
      nrm += A[p][6] * A[p][6];
    }
    nrm = sqrt(nrm);
    double dmp = nrm > 0.2 ? 0.2 / nrm : 1;
    for (int p = 0; p < 6; p++)
      u[p] += dmp * A[p][6];
  }
  if (!ok)
    return 0;
  // inverse of normal map
  double A[6][12];
  for (int p = 0; p < 6; p++)
    for (int m = 0; m < 6; m++) {
      double s = 0;
      for (int q = 0; q < 12; q++)
        s += g.C[p][q] * CC[m][q];
      A[p][m] = s;
      A[p][6 + m] = p == m;
    }
  for (int p = 0; p < 6; p++) {
    int b = p;
    for (int i = p + 1; i < 6; i++)
      if (fabs(A[i][p]) > fabs(A[b][p]))
        b = i;
    if (b != p)
      for (int k = 0; k < 12; k++) {
        double t = A[p][k];
        A[p][k] = A[b][k];
        A[b][k] = t;
      }
    double s = 1 / A[p][p];
    for (int k = 0; k < 12; k++)
      A[p][k] *= s;
    for (int i = 0; i < 6; i++)
      if (i != p) {
        double f = A[i][p];
        if (f != 0)
          for (int k = 0; k < 12; k++)
            A[i][k] -= f * A[p][k];
      }
  }
#define FIXN(vec, target)                                                                                    \
  do {                                                                                                       \
    double nn_[6];                                                                                           \
    for (int p = 0; p < 6; p++) {                                                                            \
      double s = -(target)[p];                                                                               \
      for (int q = 0; q < 12; q++)                                                                           \
        s += g.C[p][q] * (vec)[q];                                                                           \
      nn_[p] = s;                                                                                            \
    }                                                                                                        \
    for (int m = 0; m < 6; m++) {                                                                            \
      double s = 0;                                                                                          \
      for (int p = 0; p < 6; p++)                                                                            \
        s += A[m][6 + p] * nn_[p];                                                                           \
      for (int q = 0; q < 12; q++)                                                                           \
        (vec)[q] -= s * CC[m][q];                                                                            \
    }                                                                                                        \
  } while (0)
  double zero[6] = {0};
  for (int k = 0; k < 6; k++) {
    const double *a = ga->B[k];
    double t[12];
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 4; j++) {
        double s = 0;
        for (int q = 0; q < 3; q++)
          s += si[i * 3 + q] * a[q * 4 + j];
        t[i * 4 + j] = s;
      }
    double e[12];
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 4; j++) {
        double s = 0;
        for (int q = 0; q < 4; q++)
          s += t[i * 4 + q] * ri[q * 4 + j];
        e[i * 4 + j] = s;
      }
    FIXN(e, zero);
    for (int q = 0; q < 12; q++)
      n->gen[k][q] = n->h[k] * e[q];
  }
  // second order tangential
  double kf[6][21], kw[6][28];
  for (int k = 0; k < 6; k++) {
    times_f(n->gen[k], n->F, kf[k]);
    transposed_times_w(n->gen[k], n->W, kw[k]);
  }
  for (int k = 0; k < 6; k++)
    for (int l = k; l < 6; l++) {
      int c2 = idx(k, l);
      double tgt[6];
      {
        double r[7];
        for (int i = 0; i < 7; i++) {
          double s = 0;
          for (int q = 0; q < 3; q++)
            s += kf[k][i * 3 + q] * kf[l][i * 3 + q];
          for (int q = 0; q < 4; q++)
            s -= kw[k][i * 4 + q] * kw[l][i * 4 + q];
          r[i] = -0.5 * s;
        }
        for (int p = 0; p < 6; p++) {
          double s = 0;
          for (int i = 0; i < 7; i++)
            s += g.U[p][i] * r[i];
          tgt[p] = s / g.sg[p];
        }
      }
      double e[12];
      const double *a = n->gen[k], *b = n->gen[l];
      for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
          double s = 0;
          for (int r = 0; r < 4; r++)
            for (int q = 0; q < 3; q++)
              s += a[i * 4 + r] * n->K[q * 4 + r] * b[q * 4 + j] +
                   b[i * 4 + r] * n->K[q * 4 + r] * a[q * 4 + j];
          e[i * 4 + j] = -s / 2;
        }
      FIXN(e, tgt);
      // remove normal part -> tangential
      for (int p = 0; p < 6; p++) {
        double s = 0;
        for (int q = 0; q < 12; q++)
          s += g.C[p][q] * e[q];
        for (int q = 0; q < 12; q++)
          e[q] -= s * g.C[p][q];
      }
      memcpy(n->tan2[c2], e, sizeof e);
    }
  n->hastan = 1;
  return 1;
}

static int centre(Cell *n) {
  double K0[12];
  memcpy(K0, n->K, sizeof K0);
  if (centre_from(n)) {
    double s = 0;
    for (int q = 0; q < 12; q++)
      s += n->K[q] * n->K[q];
    if (s < 4 * greatest_t * greatest_t)
      return 1;
  }
  memset(n->K, 0, sizeof n->K);
  if (centre_from(n)) {
    double s = 0;
    for (int q = 0; q < 12; q++)
      s += n->K[q] * n->K[q];
    if (s < 4 * greatest_t * greatest_t)
      return 1;
  }
  memset(n->K, 0, sizeof n->K);
  return 0;
}

static void root(Cell *n, int a, double H) {
  memset(n, 0, sizeof *n);
  current = a;
  for (int k = 0; k < 6; k++)
    n->h[k] = H;
}

#endif
