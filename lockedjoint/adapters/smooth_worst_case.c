/* The smooth worst case around the functions that CasADi wrote above; see smooth_of_one.py.

   Defined above: ROWS m and JOINTS n of J, MOTIONS of the chain, and the sizes of the work
   arrays of smooth_before and smooth_after. Arrays are in CasADi's order, by columns. */
#include <math.h>

#define PAIRS (ROWS * JOINTS)

/* Reduce a symmetric matrix to a tridiagonal one by Householder reflections, as EISPACK's tred2.

   a: the matrix, by rows, of which the lower triangle is read; it becomes the product of the
   reflections. diagonal, beside: those of the tridiagonal matrix, beside[0] = 0. */
static void tridiagonal(double a[ROWS][ROWS], double *diagonal, double *beside) {
  int i, j, k;
  for (i = ROWS - 1; i > 0; i--) {
    double square = 0, scale = 0;
    for (k = 0; k < i; k++) scale += fabs(a[i][k]);
    if (i == 1 || scale == 0) {
      beside[i] = a[i][i - 1];
      diagonal[i] = 0;
      continue;
    }
    for (k = 0; k < i; k++) {
      a[i][k] /= scale;
      square += a[i][k] * a[i][k];
    }
    {
      double last = a[i][i - 1], root = last >= 0 ? -sqrt(square) : sqrt(square), half = 0;
      beside[i] = scale * root;
      square -= last * root;
      a[i][i - 1] = last - root;
      for (j = 0; j < i; j++) {
        double sum = 0;
        a[j][i] = a[i][j] / square;
        for (k = 0; k <= j; k++) sum += a[j][k] * a[i][k];
        for (k = j + 1; k < i; k++) sum += a[k][j] * a[i][k];
        beside[j] = sum / square;
        half += beside[j] * a[i][j];
      }
      half /= square + square;
      for (j = 0; j < i; j++) {
        double own = a[i][j], other = beside[j] -= half * own;
        for (k = 0; k <= j; k++) a[j][k] -= own * beside[k] + other * a[i][k];
      }
    }
    diagonal[i] = square;
  }
  diagonal[0] = beside[0] = 0;
  for (i = 0; i < ROWS; i++) { /* the product of the reflections */
    if (diagonal[i] != 0) {
      for (j = 0; j < i; j++) {
        double sum = 0;
        for (k = 0; k < i; k++) sum += a[i][k] * a[k][j];
        for (k = 0; k < i; k++) a[k][j] -= sum * a[k][i];
      }
    }
    diagonal[i] = a[i][i];
    a[i][i] = 1;
    for (j = 0; j < i; j++) a[j][i] = a[i][j] = 0;
  }
}

/* Find the eigenvalues of a tridiagonal matrix by QL with implicit shifts, as EISPACK's tql2.

   vectors: the matrix that made it tridiagonal; its columns become the eigenvectors.
   Returns 0 if it does not converge. */
static int eigenvalues(double vectors[ROWS][ROWS], double *values, double *beside) {
  int low, high, i, k, turn;
  for (i = 1; i < ROWS; i++) beside[i - 1] = beside[i];
  beside[ROWS - 1] = 0;
  for (low = 0; low < ROWS; low++) {
    for (turn = 0;; turn++) {
      double shift, root, sine = 1, cosine = 1, moved = 0;
      for (high = low; high < ROWS - 1; high++) {
        double size = fabs(values[high]) + fabs(values[high + 1]);
        if (fabs(beside[high]) + size == size) break;
      }
      if (high == low) break;
      if (turn == 50) return 0;
      shift = (values[low + 1] - values[low]) / (2 * beside[low]);
      root = sqrt(shift * shift + 1);
      shift = values[high] - values[low] + beside[low] / (shift + (shift >= 0 ? root : -root));
      for (i = high - 1; i >= low; i--) {
        double over = sine * beside[i], along = cosine * beside[i], twice;
        root = sqrt(over * over + shift * shift);
        beside[i + 1] = root;
        if (root == 0) { /* the matrix falls apart here */
          values[i + 1] -= moved;
          beside[high] = 0;
          break;
        }
        sine = over / root;
        cosine = shift / root;
        shift = values[i + 1] - moved;
        twice = (values[i] - shift) * sine + 2 * cosine * along;
        moved = sine * twice;
        values[i + 1] = shift + moved;
        shift = cosine * twice - along;
        for (k = 0; k < ROWS; k++) {
          double *row = vectors[k], next = row[i + 1];
          row[i + 1] = sine * row[i] + cosine * next;
          row[i] = cosine * row[i] - sine * next;
        }
      }
      if (root == 0 && i >= low) continue;
      values[low] -= moved;
      beside[low] = shift;
      beside[high] = 0;
    }
  }
  return 1;
}

/* Put the least eigenvalue first and the largest last, as the other functions expect. */
static void ordered(double vectors[ROWS][ROWS], double *values) {
  int i, j, k;
  for (i = 1; i < ROWS; i++) {
    for (j = i; j > 0 && values[j] < values[j - 1]; j--) {
      double kept = values[j];
      values[j] = values[j - 1];
      values[j - 1] = kept;
      for (k = 0; k < ROWS; k++) {
        kept = vectors[k][j];
        vectors[k][j] = vectors[k][j - 1];
        vectors[k][j - 1] = kept;
      }
    }
  }
}

/* Return how far from singular J is, not above 0 where the values are not to be used.

   q: positions of the joints. found: room for s and the same. gradient: room for ∂s/∂q. */
double smooth_worst_case(const double *q, double width, double *found, double *gradient) {
  double left[JOINTS][ROWS][ROWS], jacobian[PAIRS], columns[6 * MOTIONS];
  double values[ROWS], vectors[ROWS * PAIRS], beside[ROWS], work[WORK];
  const double *given[GIVEN];
  double *results[RESULTS];
  casadi_int whole[WHOLE];
  int f, i, k;
  given[0] = q;
  results[0] = &left[0][0][0];
  results[1] = jacobian;
  results[2] = columns;
  smooth_before(given, results, whole, work, 0);
  for (f = 0; f < JOINTS; f++) {
    tridiagonal(left[f], values, beside);
    if (!eigenvalues(left[f], values, beside)) return 0;
    ordered(left[f], values);
    for (i = 0; i < ROWS; i++)
      for (k = 0; k < ROWS; k++) vectors[(f * ROWS + k) * ROWS + i] = left[f][i][k];
  }
  given[0] = jacobian;
  given[1] = columns;
  given[2] = vectors;
  given[3] = &width;
  results[0] = found;
  results[1] = gradient;
  smooth_after(given, results, whole, work, 0);
  return found[1];
}
