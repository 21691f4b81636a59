/* The relaxation for one tight frame, its multipliers, and the certificate for a cell of frames.

   With V = √(7/3) V̂ F and n = Fᵀq, the 4 × 4 matrix O of the rows V̂ and q is orthogonal, and det O = 1
   can be assumed (V → −V). So O fulfils 37 equations of second degree that do not depend on W:
   OOᵀ = I (its first three rows; the fourth follows), OᵀO = I, and 18 equations "2 × 2 minor of V̂ = complementary minor, with sign".
   W enters by the 6-dimensional space of V̂ and by n = Fᵀq, n_i ≥ √ν. */
#ifndef RELAXATION_H
#define RELAXATION_H
#include "frames.h"

/* Number of inequalities: products of n_i − √ν, n_i − √ν itself, and (n_i − √ν)(largest n − n_i). */
#define INEQUALITY_COUNT 35
/* Bound A of max a_i; ν; least n_i = √ν; greatest n_i; √7 − 7√ν; allowance for the third order, times size³. */
static double limit_a, nu, n_least, n_greatest, n_excess, third_order = 0.0;
/* Duality gap at which the barrier method ends, as a part of the value. */
static double gap_share = 0.15;
/* Pairs i < j. */
static int PAIR_I[21], PAIR_J[21];
static long program_count, newton_count;
/* H: the sum of the equations times their multipliers, on (V̂, q). Th: the part of q's block that goes to
   the block of (V, q). phi, cv, c0: the inequalities times their multipliers, as a polynomial in n. */
typedef struct {
  double H[256], Th[16], phi[49], cv[7], c0, z00, cst;
  int ok;
} Multipliers;
/* Cell: all frames with the coordinates Σ τ_k gen_k + Σ τ_kτ_l tan2_kl (and a normal part that follows),
   |τ_k| ≤ 1, around (W, F). tc, h, K: its place in the chart of an atlas. */
typedef struct {
  double W[21], F[28], gen[6][12], tan2[21][12];
  Multipliers m;
  int depth;
  int hastan;
  double tc[6], h[6], K[12];
} Cell;
#define EQUATION_COUNT 37
static double EQUATIONS[EQUATION_COUNT][256], RIGHT_SIDES[EQUATION_COUNT];
/* Sign of a permutation of 0 … 3. */
static int permutation_sign(const int *p) {
  int s = 1;
  for (int i = 0; i < 4; i++)
    for (int j = i + 1; j < 4; j++)
      if (p[i] > p[j])
        s = -s;
  return s;
}

/* The 37 equations ⟨RR, (vec O)(vec O)ᵀ⟩ = RB. */
static void relations() {
  int e = 0;
  memset(EQUATIONS, 0, sizeof EQUATIONS);
#define ADD(i, j, v)                                                                                         \
  do {                                                                                                       \
    EQUATIONS[e][(i) * 16 + (j)] += (v) / 2.;                                                                \
    EQUATIONS[e][(j) * 16 + (i)] += (v) / 2.;                                                                \
  } while (0)
  for (int a = 0; a < 3; a++)
    for (int b = a; b < 4; b++) {
      for (int j = 0; j < 4; j++)
        ADD(a * 4 + j, b * 4 + j, 1.);
      RIGHT_SIDES[e] = a == b;
      e++;
    }
  for (int i = 0; i < 4; i++)
    for (int j = i; j < 4; j++) {
      for (int a = 0; a < 4; a++)
        ADD(a * 4 + i, a * 4 + j, 1.);
      RIGHT_SIDES[e] = i == j;
      e++;
    }
  for (int a = 0; a < 3; a++)
    for (int b = a + 1; b < 3; b++) {
      int c = 3 - a - b;
      for (int i = 0; i < 4; i++)
        for (int j = i + 1; j < 4; j++) {
          int k = -1, m = -1;
          for (int t = 0; t < 4; t++)
            if (t != i && t != j) {
              if (k < 0)
                k = t;
              else
                m = t;
            }
          int p1[4] = {a, b, c, 3}, p2[4] = {i, j, k, m};
          double sg = permutation_sign(p1) * permutation_sign(p2);
          ADD(a * 4 + i, b * 4 + j, 1.);
          ADD(a * 4 + j, b * 4 + i, -1.);
          ADD(c * 4 + k, 12 + m, -sg);
          ADD(c * 4 + m, 12 + k, sg);
          RIGHT_SIDES[e] = 0;
          e++;
        }
    }
}

/* Second-order expansion of a cell: normal part of V (a1, a2), of K (K2) and F (F2). */
typedef struct {
  Tangent g;
  double a1[6][36];
  double a2[21][36];
  double Kf[6][21], Kw[6][28];
  double F2[21][28];
  double K2[21][12];
} Expansion;
static int idx(int k, int l) {
  if (k > l) {
    int t = k;
    k = l;
    l = t;
  }
  return k * 6 - k * (k - 1) / 2 + (l - k);
}

static void expansion(const Cell *cell, Expansion *e) {
  const double *W = cell->W, *F = cell->F;
  Tangent *g = &e->g;
  double Bf[6][21], Bw[6][28], Cf[6][21], Cw[6][28];
  for (int k = 0; k < 6; k++) {
    times_f(g->B[k], F, Bf[k]);
    transposed_times_w(g->B[k], W, Bw[k]);
    times_f(g->C[k], F, Cf[k]);
    transposed_times_w(g->C[k], W, Cw[k]);
    times_f(cell->gen[k], F, e->Kf[k]);
    transposed_times_w(cell->gen[k], W, e->Kw[k]);
  }
  // D(L_k)[B_j], D(L_k)[C_m], D(C_m)[B_j], D(L_k)[L_l] each projected by sg^-1 U^T -> 6
  double DB[6][6][6], DC[6][6][6];
#define DD(Kf, Kw, Vf, Vw, o)                                                                                \
  do {                                                                                                       \
    double r[7];                                                                                             \
    for (int i = 0; i < 7; i++) {                                                                            \
      double s = 0;                                                                                          \
      for (int q = 0; q < 3; q++)                                                                            \
        s += (Kf)[i * 3 + q] * (Vf)[i * 3 + q];                                                              \
      for (int q = 0; q < 4; q++)                                                                            \
        s -= (Kw)[i * 4 + q] * (Vw)[i * 4 + q];                                                              \
      r[i] = s;                                                                                              \
    }                                                                                                        \
    for (int m_ = 0; m_ < 6; m_++) {                                                                         \
      double s = 0;                                                                                          \
      for (int i = 0; i < 7; i++)                                                                            \
        s += g->U[m_][i] * r[i];                                                                             \
      (o)[m_] = s / g->sg[m_];                                                                               \
    }                                                                                                        \
  } while (0)
  for (int k = 0; k < 6; k++)
    for (int j = 0; j < 6; j++) {
      DD(e->Kf[k], e->Kw[k], Bf[j], Bw[j], DB[k][j]);
      DD(e->Kf[k], e->Kw[k], Cf[j], Cw[j], DC[k][j]);
      for (int m = 0; m < 6; m++)
        e->a1[k][m * 6 + j] = -DB[k][j][m];
    }
  for (int k = 0; k < 6; k++)
    for (int l = k; l < 6; l++) {
      int c = idx(k, l);
      double kap[6];
      DD(e->Kf[k], e->Kw[k], e->Kf[l], e->Kw[l], kap);
      for (int m = 0; m < 6; m++)
        kap[m] *= -0.5;
      for (int q = 0; q < 12; q++) {
        double s = 0;
        for (int m = 0; m < 6; m++)
          s += kap[m] * g->C[m][q];
        e->K2[c][q] = s + (cell->hastan ? cell->tan2[c][q] : 0);
      }
      double k2f[21], k2w[28];
      times_f(e->K2[c], F, k2f);
      transposed_times_w(e->K2[c], W, k2w);
      double kw[28];
      transposed_times_w(e->K2[c], W, kw);
      for (int i = 0; i < 7; i++)
        for (int q = 0; q < 4; q++)
          e->F2[c][q * 7 + i] = -kw[i * 4 + q];
      double LtL[16], LLt[9];
      {
        const double *a = cell->gen[k], *b = cell->gen[l];
        for (int i = 0; i < 4; i++)
          for (int j = 0; j < 4; j++) {
            double s = 0;
            for (int q = 0; q < 3; q++)
              s += a[q * 4 + i] * b[q * 4 + j] + b[q * 4 + i] * a[q * 4 + j];
            LtL[i * 4 + j] = s / 2;
          }
        for (int i = 0; i < 3; i++)
          for (int j = 0; j < 3; j++) {
            double s = 0;
            for (int q = 0; q < 4; q++)
              s += a[i * 4 + q] * b[j * 4 + q] + b[i * 4 + q] * a[j * 4 + q];
            LLt[i * 3 + j] = s / 2;
          }
      }
      for (int q = 0; q < 4; q++)
        for (int i = 0; i < 7; i++) {
          double s = 0;
          for (int r = 0; r < 4; r++)
            s += LtL[q * 4 + r] * F[r * 7 + i];
          e->F2[c][q * 7 + i] -= s / 2;
        }
      double U1[21], U2[28];
      for (int i = 0; i < 7; i++) {
        for (int r = 0; r < 3; r++) {
          double s = 0;
          for (int q = 0; q < 3; q++)
            s += LLt[r * 3 + q] * W[q * 7 + i];
          U1[i * 3 + r] = s;
        }
        for (int r = 0; r < 4; r++) {
          double s = 0;
          for (int q = 0; q < 4; q++)
            s += LtL[r * 4 + q] * F[q * 7 + i];
          U2[i * 4 + r] = s;
        }
      }
      for (int j = 0; j < 6; j++) {
        double t[6];
        for (int m = 0; m < 6; m++) {
          double s = 0;
          for (int q = 0; q < 6; q++)
            s += 0.5 * (DC[k][q][m] * e->a1[l][q * 6 + j] + DC[l][q][m] * e->a1[k][q * 6 + j]);
          t[m] = s;
        }
        {
          double t2[6];
          DD(k2f, k2w, Bf[j], Bw[j], t2);
          for (int m = 0; m < 6; m++)
            t[m] += t2[m];
        }
        double r[7];
        const double *V = g->B[j];
        for (int i = 0; i < 7; i++) {
          double s = 0;
          for (int a = 0; a < 3; a++)
            for (int b = 0; b < 4; b++)
              s += V[a * 4 + b] * 0.5 *
                   (e->Kf[k][i * 3 + a] * e->Kw[l][i * 4 + b] + e->Kf[l][i * 3 + a] * e->Kw[k][i * 4 + b]);
          for (int a = 0; a < 3; a++)
            s += 0.5 * U1[i * 3 + a] * Bf[j][i * 3 + a];
          for (int a = 0; a < 4; a++)
            s += 0.5 * U2[i * 4 + a] * Bw[j][i * 4 + a];
          r[i] = s;
        }
        for (int m = 0; m < 6; m++) {
          double s = 0;
          for (int i = 0; i < 7; i++)
            s += g->U[m][i] * r[i];
          t[m] -= s / g->sg[m];
          e->a2[c][m * 6 + j] = -t[m];
        }
      }
    }
}

/* Weight of the first-order change of the certificate within the cell, in the choice of multipliers. */
static double beta = 3.0;
/* The same for multipliers that do not change it to first order. */
static double ridge = 1e-4;
/* Multipliers that are best for the cell: the value of the middle less beta times the norm of the first-order
   changes. The dual is solved: matrices of (q, y) and (1, q) with the equations relaxed to a ball, by a barrier
   method. Returns s; if s < 0 the multipliers exclude the middle. */
static int SV[10][10];
static double best_multipliers(const double *F, const Expansion *ex, Multipliers *m) {
  enum { D5 = 55, NV = 60, NS = 59, NQ = 55 };
  const Tangent *g = &ex->g;
  static double E[EQUATION_COUNT][D5], ZK[EQUATION_COUNT][6 * 57], ME[EQUATION_COUNT][D5], EME[D5][D5];
  {
    int c = 0;
    for (int k = 0; k < 10; k++)
      for (int l = k; l < 10; l++, c++)
        SV[k][l] = SV[l][k] = c;
  }
  for (int e = 0; e < EQUATION_COUNT; e++) {
    double t[16][10], tc[6][16];
    for (int i = 0; i < 16; i++) {
      for (int k = 0; k < 6; k++) {
        double s = 0, u = 0;
        for (int q = 0; q < 12; q++) {
          s += EQUATIONS[e][i * 16 + q] * g->B[k][q];
          u += EQUATIONS[e][i * 16 + q] * g->C[k][q];
        }
        t[i][k] = s;
        tc[k][i] = u;
      }
      for (int k = 0; k < 4; k++)
        t[i][6 + k] = EQUATIONS[e][i * 16 + 12 + k];
    }
    double Rt[100];
    for (int k = 0; k < 6; k++)
      for (int l = 0; l < 10; l++) {
        double s = 0;
        for (int q = 0; q < 12; q++)
          s += g->B[k][q] * t[q][l];
        Rt[k * 10 + l] = s;
      }
    for (int k = 0; k < 4; k++)
      for (int l = 0; l < 10; l++)
        Rt[(6 + k) * 10 + l] = t[12 + k][l];
    int c = 0;
    for (int k = 0; k < 10; k++)
      for (int l = k; l < 10; l++, c++)
        E[e][c] = Rt[k * 10 + l] * (k == l ? 1 : M_SQRT2);
    double CB[36], Cq[24];
    for (int k = 0; k < 6; k++) {
      for (int l = 0; l < 6; l++) {
        double s = 0;
        for (int q = 0; q < 12; q++)
          s += tc[k][q] * g->B[l][q];
        CB[k * 6 + l] = s;
      }
      for (int q = 0; q < 4; q++)
        Cq[k * 4 + q] = tc[k][12 + q];
    }
    int p = 0;
    for (int k = 0; k < 6; k++) {
      const double *a1 = ex->a1[k];
      double T[36];
      for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
          double s = 0;
          for (int q = 0; q < 6; q++)
            s += CB[q * 6 + i] * a1[q * 6 + j];
          T[i * 6 + j] = s;
        }
      for (int i = 0; i < 6; i++)
        for (int j = i; j < 6; j++)
          ZK[e][p++] = i == j ? 2 * T[i * 7] : M_SQRT2 * (T[i * 6 + j] + T[j * 6 + i]);
      for (int i = 0; i < 6; i++)
        for (int q = 0; q < 4; q++) {
          double s = 0;
          for (int r = 0; r < 6; r++)
            s += a1[r * 6 + i] * Cq[r * 4 + q];
          ZK[e][p++] = M_SQRT2 * s;
        }
    }
  }
  const int NP = 6 * 45;
  double L[EQUATION_COUNT * EQUATION_COUNT];
  for (int e = 0; e < EQUATION_COUNT; e++)
    for (int f = 0; f <= e; f++) {
      double s = 0;
      for (int p = 0; p < NP; p++)
        s += ZK[e][p] * ZK[f][p];
      L[e * EQUATION_COUNT + f] = s + (e == f) * ridge;
    }
  if (!cholesky(EQUATION_COUNT, L, EQUATION_COUNT)) {
    m->ok = 0;
    return 0;
  }
  // ME = L^-1 E  (so EME = ME^T ME)
  for (int e = 0; e < EQUATION_COUNT; e++) {
    double v[D5];
    memcpy(v, E[e], sizeof v);
    for (int k = 0; k < e; k++) {
      double t = L[e * EQUATION_COUNT + k];
      for (int c = 0; c < D5; c++)
        v[c] -= t * ME[k][c];
    }
    double t = 1 / L[e * EQUATION_COUNT + e];
    for (int c = 0; c < D5; c++)
      ME[e][c] = v[c] * t;
  }
  for (int i = 0; i < D5; i++)
    for (int j = 0; j <= i; j++)
      EME[i][j] = 0;
  for (int e = 0; e < EQUATION_COUNT; e++)
    for (int i = 0; i < D5; i++) {
      double t = ME[e][i];
      for (int j = 0; j <= i; j++)
        EME[i][j] += t * ME[e][j];
    }
  for (int i = 0; i < D5; i++)
    for (int j = 0; j < i; j++)
      EME[j][i] = EME[i][j];
  double x[NV] = {0};
  {
    static double NM[EQUATION_COUNT * EQUATION_COUNT];
    for (int r = 0; r < EQUATION_COUNT; r++)
      for (int q = 0; q <= r; q++) {
        double s = 0;
        for (int c = 0; c < D5; c++)
          s += E[r][c] * E[q][c];
        NM[r * EQUATION_COUNT + q] = s + (r == q) * 1e-9;
      }
    cholesky(EQUATION_COUNT, NM, EQUATION_COUNT);
    double p[EQUATION_COUNT];
    for (int i = 0; i < EQUATION_COUNT; i++) {
      double s = RIGHT_SIDES[i];
      for (int k = 0; k < i; k++)
        s -= NM[i * EQUATION_COUNT + k] * p[k];
      p[i] = s / NM[i * EQUATION_COUNT + i];
    }
    for (int i = EQUATION_COUNT - 1; i >= 0; i--) {
      double s = p[i];
      for (int k = i + 1; k < EQUATION_COUNT; k++)
        s -= NM[k * EQUATION_COUNT + i] * p[k];
      p[i] = s / NM[i * EQUATION_COUNT + i];
    }
    for (int e = 0; e < EQUATION_COUNT; e++)
      for (int c = 0; c < D5; c++)
        x[c] += p[e] * E[e][c];
  }
  for (int k = 0; k < 4; k++) {
    double s = 0;
    for (int i = 0; i < 7; i++)
      s += F[k * 7 + i];
    x[NQ + k] = s / sqrt(7.) * 0.9;
  }
  // reduced directions for X and g: r index: 0..9 Q entries, 10..13 q, 14 s
  int rv[15];
  {
    int c = 0;
    for (int i = 0; i < 4; i++)
      for (int j = i; j < 4; j++)
        rv[c++] = SV[6 + i][6 + j];
    for (int i = 0; i < 4; i++)
      rv[c++] = NQ + i;
    rv[14] = NS;
  }
  static double DX[15][25], DG[15][INEQUALITY_COUNT];
  double g0[INEQUALITY_COUNT];
  memset(DX, 0, sizeof DX);
  {
    int c = 0;
    for (int i = 0; i < 4; i++)
      for (int j = i; j < 4; j++, c++) {
        double v = i == j ? 1 : M_SQRT1_2;
        DX[c][(i + 1) * 5 + j + 1] = DX[c][(j + 1) * 5 + i + 1] = v;
      }
    for (int i = 0; i < 4; i++)
      DX[10 + i][i + 1] = DX[10 + i][(i + 1) * 5] = 1;
    for (int i = 0; i < 5; i++)
      DX[14][i * 6] = -1;
  }
  for (int v = -1; v < 15; v++) {
    double X0[25] = {1};
    const double *X = v < 0 ? X0 : DX[v];
    double *o = v < 0 ? g0 : DG[v];
    if (v == 14) {
      for (int i = 0; i < INEQUALITY_COUNT; i++)
        o[i] = -1;
      break;
    }
    double one = v < 0;
    double n[7], T[4][7], nn[7][7];
    for (int i = 0; i < 7; i++) {
      double s = 0;
      for (int k = 0; k < 4; k++)
        s += X[k + 1] * F[k * 7 + i];
      n[i] = s;
      for (int k = 0; k < 4; k++) {
        double t = 0;
        for (int l = 0; l < 4; l++)
          t += X[(k + 1) * 5 + l + 1] * F[l * 7 + i];
        T[k][i] = t;
      }
    }
    for (int i = 0; i < 7; i++)
      for (int j = i; j < 7; j++) {
        double s = 0;
        for (int k = 0; k < 4; k++)
          s += F[k * 7 + i] * T[k][j];
        nn[i][j] = s;
      }
    for (int p = 0; p < 21; p++) {
      int i = PAIR_I[p], j = PAIR_J[p];
      o[p] = nn[i][j] - n_least * (n[i] + n[j]) + one * n_least * n_least;
    }
    for (int i = 0; i < 7; i++) {
      o[21 + i] = n[i] - one * n_least;
      o[28 + i] = (n_least + n_greatest) * n[i] - nn[i][i] - one * n_least * n_greatest;
    }
  }
  double Y[100], X[25], gg[INEQUALITY_COUNT], y[EQUATION_COUNT], phi;
#define EVAL6(xx)                                                                                            \
  do {                                                                                                       \
    for (int k = 0; k < 10; k++)                                                                             \
      for (int l = 0; l < 10; l++)                                                                           \
        Y[k * 10 + l] = (xx)[SV[k][l]] * (k == l ? 1 : M_SQRT1_2) - (k == l) * (xx)[NS];                     \
    memset(X, 0, sizeof X);                                                                                  \
    X[0] = 1;                                                                                                \
    for (int v = 0; v < 15; v++) {                                                                           \
      double t = (xx)[rv[v]];                                                                                \
      for (int i = 0; i < 25; i++)                                                                           \
        X[i] += t * DX[v][i];                                                                                \
    }                                                                                                        \
    for (int i = 0; i < INEQUALITY_COUNT; i++) {                                                             \
      double s = g0[i];                                                                                      \
      for (int v = 0; v < 15; v++)                                                                           \
        s += (xx)[rv[v]] * DG[v][i];                                                                         \
      gg[i] = s;                                                                                             \
    }                                                                                                        \
    {                                                                                                        \
      double rr[EQUATION_COUNT];                                                                             \
      for (int e = 0; e < EQUATION_COUNT; e++) {                                                             \
        double s = RIGHT_SIDES[e];                                                                           \
        for (int c = 0; c < D5; c++)                                                                         \
          s -= E[e][c] * (xx)[c];                                                                            \
        for (int k = 0; k < e; k++)                                                                          \
          s -= L[e * EQUATION_COUNT + k] * rr[k];                                                            \
        rr[e] = s / L[e * EQUATION_COUNT + e];                                                               \
      }                                                                                                      \
      phi = beta * beta;                                                                                     \
      for (int e = 0; e < EQUATION_COUNT; e++) {                                                             \
        y[e] = rr[e];                                                                                        \
        phi -= rr[e] * rr[e];                                                                                \
      }                                                                                                      \
    }                                                                                                        \
  } while (0)
  EVAL6(x);
  double s0 = least_eigenvalue(10, Y, 10), s1 = least_eigenvalue(5, X, 5);
  if (s1 < s0)
    s0 = s1;
  for (int i = 0; i < INEQUALITY_COUNT; i++)
    if (gg[i] < s0)
      s0 = gg[i];
  x[NS] = s0 - 0.3;
  double tau = 20;
  double PY[100], PX[25];
  int good = 0;
  const double NB = 10 + 5 + INEQUALITY_COUNT + 2;
  static double H[NV * NV];
  for (int it = 0; it < 80; it++) {
    newton_count++;
    EVAL6(x);
    double LY[100], LX[25];
    memcpy(LY, Y, sizeof Y);
    memcpy(LX, X, sizeof X);
    if (phi <= 0 || !cholesky(10, LY, 10) || !cholesky(5, LX, 5))
      break;
    inverse_from_cholesky(10, LY, 10, PY);
    inverse_from_cholesky(5, LX, 5, PX);
    double gr[NV] = {0};
    double ig[INEQUALITY_COUNT];
    for (int i = 0; i < INEQUALITY_COUNT; i++)
      ig[i] = 1 / gg[i];
    // Y block
    int c = 0;
    double P2[100];
    for (int i = 0; i < 10; i++)
      for (int j = 0; j < 10; j++) {
        double s = 0;
        for (int k = 0; k < 10; k++)
          s += PY[i * 10 + k] * PY[k * 10 + j];
        P2[i * 10 + j] = s;
      }
    for (int i = 0; i < 10; i++)
      for (int j = i; j < 10; j++, c++) {
        double si = i == j ? M_SQRT1_2 : 1;
        gr[c] = -PY[i * 10 + j] * si * M_SQRT2;
        int e = 0;
        for (int k = 0; k <= i; k++)
          for (int l = k; l < 10; l++, e++) {
            if (e > c)
              break;
            double sk = k == l ? M_SQRT1_2 : 1;
            H[c * NV + e] = si * sk * (PY[i * 10 + k] * PY[j * 10 + l] + PY[i * 10 + l] * PY[j * 10 + k]);
          }
        H[NS * NV + c] = -P2[i * 10 + j] * si * M_SQRT2;
      }
    for (int k = 0; k < 4; k++)
      for (int e = 0; e < NV; e++)
        if (e <= NQ + k)
          H[(NQ + k) * NV + e] = 0;
    for (int k = 0; k < 4; k++)
      H[NS * NV + NQ + k] = 0;
    double tp = 0, tp2 = 0;
    for (int i = 0; i < 10; i++) {
      tp += PY[i * 11];
      tp2 += P2[i * 11];
    }
    gr[NS] = tp - tau;
    H[NS * NV + NS] = tp2;
    // X and g
    static double TX[15][25], TG[15][INEQUALITY_COUNT];
    for (int v = 0; v < 15; v++) {
      double t[25];
      for (int i = 0; i < 5; i++)
        for (int j = 0; j < 5; j++) {
          double s = 0;
          for (int k = 0; k < 5; k++)
            s += PX[i * 5 + k] * DX[v][k * 5 + j];
          t[i * 5 + j] = s;
        }
      for (int i = 0; i < 5; i++)
        for (int j = 0; j < 5; j++) {
          double s = 0;
          for (int k = 0; k < 5; k++)
            s += t[i * 5 + k] * PX[k * 5 + j];
          TX[v][i * 5 + j] = s;
        }
      double s = 0;
      for (int i = 0; i < 25; i++)
        s += PX[i] * DX[v][i];
      for (int i = 0; i < INEQUALITY_COUNT; i++) {
        s += ig[i] * DG[v][i];
        TG[v][i] = DG[v][i] * ig[i] * ig[i];
      }
      gr[rv[v]] -= s;
      for (int w = 0; w <= v; w++) {
        double s = 0;
        for (int i = 0; i < 25; i++)
          s += TX[v][i] * DX[w][i];
        for (int i = 0; i < INEQUALITY_COUNT; i++)
          s += TG[v][i] * DG[w][i];
        int a = rv[v], b = rv[w];
        if (a >= b)
          H[a * NV + b] += s;
        else
          H[b * NV + a] += s;
      }
    }
    // SOC
    double gp[D5] = {0};
    for (int e = 0; e < EQUATION_COUNT; e++) {
      double t = 2 * y[e];
      for (int c = 0; c < D5; c++)
        gp[c] += t * ME[e][c];
    } // d phi/dm = +2 ME^T y
    double ip = 1 / phi;
    for (int c = 0; c < D5; c++)
      gr[c] -= ip * gp[c];
    for (int c = 0; c < D5; c++)
      for (int e = 0; e <= c; e++)
        H[c * NV + e] += 2 * ip * EME[c][e] + ip * ip * gp[c] * gp[e];
    if (!cholesky(NV, H, NV))
      break;
    double p[NV];
    for (int i = 0; i < NV; i++) {
      double s = -gr[i];
      for (int k = 0; k < i; k++)
        s -= H[i * NV + k] * p[k];
      p[i] = s / H[i * NV + i];
    }
    double dec = 0;
    for (int i = 0; i < NV; i++)
      dec += p[i] * p[i];
    dec = sqrt(dec);
    for (int i = NV - 1; i >= 0; i--) {
      double s = p[i];
      p[i] = s / H[i * NV + i];
      for (int k = 0; k < i; k++)
        p[k] -= H[i * NV + k] * p[i];
    }
    double gap = NB / tau;
    if (dec < 0.5) {
      if (x[NS] > 0)
        break;
      if (dec < 0.1 && x[NS] + gap < 0 && (gap < gap_share * (-x[NS]))) {
        good = 1;
        break;
      }
      if (dec < 0.1 && tau >= 2e6)
        break;
    }
    double al = dec < 0.3 ? 1 : 1 / (1 + dec);
    if (dec >= 0.3) {
      double al2 = 0.95, phi0 = phi;
      for (int k = 0; k < 12; k++) {
        double xn[NV];
        for (int i = 0; i < NV; i++)
          xn[i] = x[i] + al2 * p[i];
        EVAL6(xn);
        double a1[100], a2[25];
        memcpy(a1, Y, sizeof Y);
        memcpy(a2, X, sizeof X);
        int ok = phi > 0 && cholesky(10, a1, 10) && cholesky(5, a2, 5);
        if (ok)
          for (int i = 0; i < INEQUALITY_COUNT; i++)
            if (gg[i] <= 0)
              ok = 0;
        if (ok) {
          double f = -tau * p[NS] * al2;
          double l = log(phi / phi0);
          for (int i = 0; i < 10; i++)
            l += 2 * log(a1[i * 11] / LY[i * 11]);
          for (int i = 0; i < 5; i++)
            l += 2 * log(a2[i * 6] / LX[i * 6]);
          for (int i = 0; i < INEQUALITY_COUNT; i++)
            l += log(gg[i] * ig[i]);
          if (f - l < -0.1 * al2 * dec * dec) {
            al = al2;
            break;
          }
        }
        al2 *= 0.6;
        if (al2 < al)
          break;
      }
    }
    for (int i = 0; i < NV; i++)
      x[i] += al * p[i];
    if (dec < 0.5 && (tau < 2e6) && !(x[NS] + gap < 0 && gap < gap_share * -x[NS]))
      tau *= 5;
  }
  m->ok = 0;
  if (!good)
    return x[NS];
  EVAL6(x);
  double ZX[25];
  for (int i = 0; i < 25; i++)
    ZX[i] = PX[i] / tau;
  memset(m->phi, 0, sizeof m->phi);
  memset(m->cv, 0, sizeof m->cv);
  m->c0 = 0;
  for (int p = 0; p < 21; p++) {
    double f = 1 / (tau * gg[p]);
    int i = PAIR_I[p], j = PAIR_J[p];
    m->phi[i * 7 + j] += f / 2;
    m->phi[j * 7 + i] += f / 2;
    m->cv[i] += n_least * f;
    m->cv[j] += n_least * f;
    m->c0 -= n_least * n_least * f;
  }
  for (int i = 0; i < 7; i++) {
    double f = 1 / (tau * gg[21 + i]);
    m->cv[i] -= f;
    m->c0 += n_least * f;
    f = 1 / (tau * gg[28 + i]);
    m->phi[i * 8] -= f;
    m->cv[i] -= (n_least + n_greatest) * f;
    m->c0 += n_least * n_greatest * f;
  }
  double FPF[16];
  for (int a = 0; a < 4; a++)
    for (int c = 0; c < 4; c++) {
      double s = 0;
      for (int i = 0; i < 7; i++)
        for (int j = 0; j < 7; j++)
          s += F[a * 7 + i] * m->phi[i * 7 + j] * F[c * 7 + j];
      FPF[a * 4 + c] = s;
    }
  // lambda = -2 M r/(phi tau), M r = L^-T y
  double p[EQUATION_COUNT];
  for (int e = 0; e < EQUATION_COUNT; e++)
    p[e] = y[e];
  for (int i = EQUATION_COUNT - 1; i >= 0; i--) {
    double s = p[i];
    for (int k = i + 1; k < EQUATION_COUNT; k++)
      s -= L[k * EQUATION_COUNT + i] * p[k];
    p[i] = s / L[i * EQUATION_COUNT + i];
  }
  for (int e = 0; e < EQUATION_COUNT; e++)
    p[e] *= -2 / (phi * tau);
  memset(m->H, 0, sizeof m->H);
  m->cst = 0;
  for (int e = 0; e < EQUATION_COUNT; e++) {
    m->cst += p[e] * RIGHT_SIDES[e];
    for (int i = 0; i < 256; i++)
      m->H[i] += p[e] * EQUATIONS[e][i];
  }
  for (int a = 0; a < 4; a++)
    for (int c = 0; c < 4; c++)
      m->Th[a * 4 + c] = m->H[(12 + a) * 16 + 12 + c] - FPF[a * 4 + c] - ZX[(a + 1) * 5 + c + 1];
  m->z00 = ZX[0];
  m->ok = 1;
  return x[NS];
}

/* Negative part of a symmetric matrix. */
static void negative_part(int n, const double *M, double *o) {
  double a[100], w[10], v[100];
  memcpy(a, M, n * n * sizeof(double));
  eigen(n, a, w, v);
  memset(o, 0, n * n * sizeof(double));
  for (int k = 0; k < n; k++)
    if (w[k] < 0)
      for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
          o[i * n + j] += w[k] * v[i * n + k] * v[j * n + k];
}

/* Least value over the cell, up to third order; above 0: the cell is excluded. The value is concave in each τ_k
   once the positive parts of the squares τ_k² are left out, so its least value is at one of 64 vertices. */
static double least_value(const Cell *cell, const Expansion *e, const Multipliers *m, int quick, int *split) {
  const Tangent *g = &e->g;
  const double *F = cell->F;
  static double ZY[1 + 6 + 21][100], ZX[28][25];
  double cs0;
  double HB[6][16], HC[6][16], HBB[36], HCB[36], HCC[36], HBq[24], HCq[24];
  for (int k = 0; k < 6; k++)
    for (int i = 0; i < 16; i++) {
      double s = 0, t = 0;
      for (int q = 0; q < 12; q++) {
        s += m->H[i * 16 + q] * g->B[k][q];
        t += m->H[i * 16 + q] * g->C[k][q];
      }
      HB[k][i] = s;
      HC[k][i] = t;
    }
  for (int k = 0; k < 6; k++) {
    for (int l = 0; l < 6; l++) {
      double s = 0, t = 0, u = 0;
      for (int q = 0; q < 12; q++) {
        s += HB[k][q] * g->B[l][q];
        t += g->C[k][q] * HB[l][q];
        u += HC[k][q] * g->C[l][q];
      }
      HBB[k * 6 + l] = s;
      HCB[k * 6 + l] = t;
      HCC[k * 6 + l] = u;
    }
    for (int q = 0; q < 4; q++) {
      HBq[k * 4 + q] = HB[k][12 + q];
      HCq[k * 4 + q] = HC[k][12 + q];
    }
  }
  memset(ZY, 0, sizeof ZY);
  for (int i = 0; i < 6; i++) {
    for (int j = 0; j < 6; j++)
      ZY[0][i * 10 + j] = HBB[i * 6 + j];
    for (int q = 0; q < 4; q++)
      ZY[0][i * 10 + 6 + q] = ZY[0][(6 + q) * 10 + i] = HBq[i * 4 + q];
  }
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++)
      ZY[0][(6 + i) * 10 + 6 + j] = m->Th[i * 4 + j];
  double HA[6][36];
  for (int k = 0; k < 6; k++) {
    double t1[36];
    for (int i = 0; i < 6; i++)
      for (int j = 0; j < 6; j++) {
        double s = 0, t = 0;
        for (int q = 0; q < 6; q++) {
          s += HCB[q * 6 + i] * e->a1[k][q * 6 + j];
          t += HCC[i * 6 + q] * e->a1[k][q * 6 + j];
        }
        t1[i * 6 + j] = s;
        HA[k][i * 6 + j] = t;
      }
    for (int i = 0; i < 6; i++)
      for (int j = 0; j < 6; j++)
        ZY[1 + k][i * 10 + j] = t1[i * 6 + j] + t1[j * 6 + i];
    for (int i = 0; i < 6; i++)
      for (int q = 0; q < 4; q++) {
        double s = 0;
        for (int r = 0; r < 6; r++)
          s += e->a1[k][r * 6 + i] * HCq[r * 4 + q];
        ZY[1 + k][i * 10 + 6 + q] = ZY[1 + k][(6 + q) * 10 + i] = s;
      }
  }
  for (int k = 0; k < 6; k++)
    for (int l = k; l < 6; l++) {
      int c = idx(k, l);
      double *Z = ZY[7 + c];
      double t1[36];
      for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
          double s = 0;
          for (int q = 0; q < 6; q++)
            s += HCB[q * 6 + i] * e->a2[c][q * 6 + j] + 0.5 * e->a1[k][q * 6 + i] * HA[l][q * 6 + j];
          t1[i * 6 + j] = s;
        }
      for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
          Z[i * 10 + j] = t1[i * 6 + j] + t1[j * 6 + i];
      for (int i = 0; i < 6; i++)
        for (int q = 0; q < 4; q++) {
          double s = 0;
          for (int r = 0; r < 6; r++)
            s += e->a2[c][r * 6 + i] * HCq[r * 4 + q];
          Z[i * 10 + 6 + q] = Z[(6 + q) * 10 + i] = s;
        }
    }
  cs0 = m->cst + m->z00 - m->c0;
  const double *cv = m->cv;
  double FP[4][7], F1[6][28], F1P[6][28];
  for (int a = 0; a < 4; a++)
    for (int i = 0; i < 7; i++) {
      double s = 0;
      for (int j = 0; j < 7; j++)
        s += F[a * 7 + j] * m->phi[j * 7 + i];
      FP[a][i] = s;
    }
  for (int k = 0; k < 6; k++)
    for (int a = 0; a < 4; a++)
      for (int i = 0; i < 7; i++)
        F1[k][a * 7 + i] = -e->Kw[k][i * 4 + a];
  for (int k = 0; k < 6; k++)
    for (int a = 0; a < 4; a++)
      for (int i = 0; i < 7; i++) {
        double s = 0;
        for (int j = 0; j < 7; j++)
          s += F1[k][a * 7 + j] * m->phi[j * 7 + i];
        F1P[k][a * 7 + i] = s;
      }
  for (int z = 0; z < 28; z++) {
    double *Z = ZX[z];
    Z[0] = z ? 0 : m->z00;
    const double *Fz = z == 0 ? F : z < 7 ? F1[z - 1] : e->F2[z - 7];
    for (int a = 0; a < 4; a++) {
      double s = 0;
      for (int i = 0; i < 7; i++)
        s += Fz[a * 7 + i] * cv[i];
      Z[a + 1] = Z[(a + 1) * 5] = s / 2;
    }
    for (int a = 0; a < 4; a++)
      for (int b = 0; b < 4; b++) {
        double s = 0;
        for (int i = 0; i < 7; i++)
          s += Fz[a * 7 + i] * FP[b][i] + (z ? FP[a][i] * Fz[b * 7 + i] : 0);
        Z[(a + 1) * 5 + b + 1] = -s + (z ? 0 : m->H[(12 + a) * 16 + 12 + b] - m->Th[a * 4 + b]);
      }
  }
  for (int k = 0; k < 6; k++)
    for (int l = k; l < 6; l++) {
      double *Z = ZX[7 + idx(k, l)];
      for (int a = 0; a < 4; a++)
        for (int b = 0; b < 4; b++) {
          double s = 0;
          for (int i = 0; i < 7; i++)
            s += F1P[k][a * 7 + i] * F1[l][b * 7 + i] + F1P[l][a * 7 + i] * F1[k][b * 7 + i];
          Z[(a + 1) * 5 + b + 1] -= s / 2;
        }
    }
  double size2 = 0;
  for (int k = 0; k < 6; k++)
    for (int q = 0; q < 12; q++)
      size2 += cell->gen[k][q] * cell->gen[k][q];
  double t3 = third_order * size2 * sqrt(size2);
#define FVAL(y, x) (4 * least_eigenvalue(10, y, 10) + 2 * least_eigenvalue(5, x, 5) - cs0 - t3)
  double best = 1e300;
  int bv = 0;
  double f00 = FVAL(ZY[0], ZX[0]);
  if (f00 <= 0) {
    best = f00;
    if (quick)
      return f00;
  }
  double NY[100] = {0}, NX[25] = {0};
  for (int k = 0; k < 6; k++) {
    int c = 7 + idx(k, k);
    double o[100];
    negative_part(10, ZY[c], o);
    for (int i = 0; i < 100; i++)
      NY[i] += o[i];
    negative_part(5, ZX[c], o);
    for (int i = 0; i < 25; i++)
      NX[i] += o[i];
  }
  for (int v = 0; v < 64; v++) {
    double T[6];
    for (int k = 0; k < 6; k++)
      T[k] = ((v * 37) >> k & 1) ? 1 : -1;
    double y[100], x[25];
    for (int i = 0; i < 100; i++)
      y[i] = ZY[0][i] + NY[i];
    for (int i = 0; i < 25; i++)
      x[i] = ZX[0][i] + NX[i];
    for (int k = 0; k < 6; k++) {
      for (int i = 0; i < 100; i++)
        y[i] += T[k] * ZY[1 + k][i];
      for (int i = 0; i < 25; i++)
        x[i] += T[k] * ZX[1 + k][i];
      for (int l = k + 1; l < 6; l++) {
        double s = 2 * T[k] * T[l];
        int z = 7 + idx(k, l);
        for (int i = 0; i < 100; i++)
          y[i] += s * ZY[z][i];
        for (int i = 0; i < 25; i++)
          x[i] += s * ZX[z][i];
      }
    }
    double f = FVAL(y, x);
    if (f < best) {
      best = f;
      bv = v * 37;
    }
    if (quick && f <= 0)
      return f;
  }
  if (split && best <= 0) {
    double bf = -1e300;
    int bk = 0;
    for (int q = 0; q < 6; q++) {
      double T[6];
      for (int k = 0; k < 6; k++)
        T[k] = k == q ? 0 : (bv >> k & 1) ? 1 : -1;
      double y[100], x[25];
      for (int i = 0; i < 100; i++)
        y[i] = ZY[0][i];
      for (int i = 0; i < 25; i++)
        x[i] = ZX[0][i];
      for (int k = 0; k < 6; k++) {
        for (int i = 0; i < 100; i++)
          y[i] += T[k] * ZY[1 + k][i];
        for (int i = 0; i < 25; i++)
          x[i] += T[k] * ZX[1 + k][i];
        for (int l = k; l < 6; l++) {
          double s = (k == l ? 1 : 2) * T[k] * T[l];
          int z = 7 + idx(k, l);
          for (int i = 0; i < 100; i++)
            y[i] += s * ZY[z][i];
          for (int i = 0; i < 25; i++)
            x[i] += s * ZX[z][i];
        }
      }
      double f = FVAL(y, x);
      if (f > bf) {
        bf = f;
        bk = q;
      }
    }
    *split = bk;
  }
  return best;
}

/* 1 if no n with n_i ≥ √ν, |n| = 1 fulfils Wn = 0 in the cell: √ν Σω_i is not in −(√7 − 7√ν) conv(ω_i). */
static int has_no_null_vector(const Cell *cell, double size2) {
  const double *W = cell->W, *F = cell->F;
  double g[3] = {0};
  double x[3];
  for (int r = 0; r < 3; r++) {
    for (int i = 0; i < 7; i++)
      g[r] += W[r * 7 + i];
  }
  double ng = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  if (ng < 1e-12)
    return 0;
  for (int r = 0; r < 3; r++)
    x[r] = g[r] / ng;
  double kf[6][21];
  for (int k = 0; k < 6; k++)
    times_f(cell->gen[k], F, kf[k]);
  for (int it = 0; it < 12; it++) {
    // bound: lo*sum - rem - smax*... affine in t and min over i : concave -> for each i: affine fn lower bound
    double worst = 1e300;
    int wi = 0;
    double s0 = 0, sk[6] = {0};
    for (int r = 0; r < 3; r++) {
      s0 += x[r] * g[r];
      for (int k = 0; k < 6; k++)
        for (int i = 0; i < 7; i++)
          sk[k] += x[r] * kf[k][i * 3 + r];
    }
    double rem = 1.0 * size2 * (n_least * 2.65 + n_excess * 0.76); // |K2| <= size2 roughly
    for (int i = 0; i < 7; i++) {
      double c = 0;
      for (int r = 0; r < 3; r++)
        c += x[r] * W[r * 7 + i];
      double f = n_least * s0 + n_excess * c;
      for (int k = 0; k < 6; k++) {
        double t = 0;
        for (int r = 0; r < 3; r++)
          t += x[r] * kf[k][i * 3 + r];
        f -= fabs(n_least * sk[k] + n_excess * t);
      }
      f -= rem;
      if (f < worst) {
        worst = f;
        wi = i;
      }
    }
    if (worst > 0)
      return 1;
    // subgradient step on middle
    double st = 0.5 / (1 + it);
    double gr[3], n = 0;
    for (int r = 0; r < 3; r++)
      gr[r] = n_least * g[r] + n_excess * W[r * 7 + wi];
    double gn = sqrt(gr[0] * gr[0] + gr[1] * gr[1] + gr[2] * gr[2]) + 1e-15;
    for (int r = 0; r < 3; r++)
      x[r] += st * gr[r] / gn;
    n = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    for (int r = 0; r < 3; r++)
      x[r] /= n;
  }
  return 0;
}

static void constants(double A) {
  limit_a = A;
  nu = (1 - 3 * limit_a) / 7;
  n_least = sqrt(nu);
  n_greatest = sqrt(1 - 6 * nu);
  n_excess = sqrt(7.) - 7 * n_least;
  relations();
  int p = 0;
  for (int i = 0; i < 7; i++)
    for (int j = i + 1; j < 7; j++) {
      PAIR_I[p] = i;
      PAIR_J[p] = j;
      p++;
    }
}
#endif
