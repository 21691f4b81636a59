/* Unit revolute joints, written out by hand: what the arithmetic itself costs.
   `levenberg_marquardt` minimises the residual. With `exact`, the Hessian is exact; else Gauss
   and Newton's. `max_min` continues from there with an interior point method on the reduced
   statement: minimise -log t subject to j_f' P j_f <= 1 for all f, P = (JJ' - tI)^-1. */
#include <math.h>
#include <string.h>

#define MAX_JOINTS 32
#define N (3 * MAX_JOINTS)

static double half_norm(int n, const double *x, double j[][6], double s[6][6]) {
    double f = 0;
    for (int i = 0; i < n; i++) {
        double sa = sin(x[3*i]), ca = cos(x[3*i]), sb = sin(x[3*i+1]), cb = cos(x[3*i+1]);
        double sc = sin(x[3*i+2]), cc = cos(x[3*i+2]);
        j[i][0] = cc*ca*sb + sc*sa; j[i][1] = cc*sa*sb - sc*ca; j[i][2] = -cc*cb;
        j[i][3] = ca*cb; j[i][4] = sa*cb; j[i][5] = sb;
    }
    for (int a = 0; a < 6; a++)
        for (int b = 0; b <= a; b++) {
            double sum = a == b ? -n / 3.0 : 0.0;
            for (int i = 0; i < n; i++) sum += j[i][a] * j[i][b];
            s[a][b] = s[b][a] = sum;
            f += (a == b ? 0.5 : 1.0) * sum * sum;
        }
    return f;
}

static void slopes(int n, const double *x, double j[][6], double d[][6]) {
    for (int i = 0; i < n; i++) {
        double sa = sin(x[3*i]), ca = cos(x[3*i]), sb = sin(x[3*i+1]), cb = cos(x[3*i+1]);
        double sc = sin(x[3*i+2]), cc = cos(x[3*i+2]);
        double *p = d[3*i], *q = d[3*i+1], *r = d[3*i+2];
        p[0] = -j[i][1]; p[1] = j[i][0]; p[2] = 0; p[3] = -j[i][4]; p[4] = j[i][3]; p[5] = 0;
        q[0] = cc*ca*cb; q[1] = cc*sa*cb; q[2] = cc*sb; q[3] = -ca*sb; q[4] = -sa*sb; q[5] = cb;
        r[0] = -sc*ca*sb + cc*sa; r[1] = -sc*sa*sb - cc*ca; r[2] = sc*cb; r[3] = r[4] = r[5] = 0;
    }
}

static double dot(const double *a, const double *b) {
    double sum = 0;
    for (int k = 0; k < 6; k++) sum += a[k] * b[k];
    return sum;
}

/* Sum of y_k d2j/dp dq over the entries, for the six pairs of a joint's angles. */
static void bend(const double *x, const double *j, const double *y, double h[3][3]) {
    double sa = sin(x[0]), ca = cos(x[0]), sb = sin(x[1]), cb = cos(x[1]);
    double sc = sin(x[2]), cc = cos(x[2]);
    h[0][0] = -(y[0]*j[0] + y[1]*j[1] + y[3]*j[3] + y[4]*j[4]);
    h[1][0] = -y[0]*cc*sa*cb + y[1]*cc*ca*cb + y[3]*sa*sb - y[4]*ca*sb;
    h[1][1] = -y[0]*cc*ca*sb - y[1]*cc*sa*sb + y[2]*cc*cb - y[3]*ca*cb - y[4]*sa*cb - y[5]*sb;
    h[2][0] = y[0]*(sc*sa*sb + cc*ca) + y[1]*(-sc*ca*sb + cc*sa);
    h[2][1] = -sc*(y[0]*ca*cb + y[1]*sa*cb + y[2]*sb);
    h[2][2] = -(y[0]*j[0] + y[1]*j[1] + y[2]*j[2]);
}

static void derivatives(int n, int exact, const double *x, double j[][6], double s[6][6],
                        double g[N], double h[N][N]) {
    static _Thread_local double d[N][6], sj[MAX_JOINTS][6], sd[6];
    slopes(n, x, j, d);
    for (int i = 0; i < n; i++)
        for (int a = 0; a < 6; a++) sj[i][a] = dot(s[a], j[i]);
    for (int p = 0; p < 3 * n; p++) {
        g[p] = 2 * dot(d[p], sj[p / 3]);
        for (int q = 0; q <= p; q++) /* <dS_p, dS_q> = 2 (d_p.d_q)(j_p.j_q) + 2 (d_p.j_q)(j_p.d_q) */
            h[p][q] = 2 * (dot(d[p], d[q]) * dot(j[p/3], j[q/3])
                           + dot(d[p], j[q/3]) * dot(j[p/3], d[q]));
    }
    if (!exact) return;
    for (int i = 0; i < n; i++) {
        double b[3][3];
        bend(x + 3*i, j[i], sj[i], b);
        for (int p = 0; p < 3; p++) {
            for (int a = 0; a < 6; a++) sd[a] = dot(s[a], d[3*i+p]);
            for (int q = 0; q <= p; q++) h[3*i+p][3*i+q] += 2 * (dot(sd, d[3*i+q]) + b[p][q]);
        }
    }
}

/* Solve (h + mu I) step = -g by Cholesky; 0 if it is not positive definite. */
static int solve(int size, double h[N][N], double mu, const double *g, double *step) {
    static _Thread_local double l[N][N];
    for (int p = 0; p < size; p++) {
        for (int q = 0; q <= p; q++) {
            double sum = h[p][q] + (p == q ? mu : 0);
            for (int k = 0; k < q; k++) sum -= l[p][k] * l[q][k];
            if (p != q) l[p][q] = sum / l[q][q];
            else if (sum <= 1e-14) return 0;
            else l[p][p] = sqrt(sum);
        }
        double sum = -g[p];
        for (int k = 0; k < p; k++) sum -= l[p][k] * step[k];
        step[p] = sum / l[p][p];
    }
    for (int p = size - 1; p >= 0; p--) {
        double sum = step[p];
        for (int k = p + 1; k < size; k++) sum -= l[k][p] * step[k];
        step[p] = sum / l[p][p];
    }
    return 1;
}

int levenberg_marquardt(int n, int exact, int most, double tolerance, double *x, double *out) {
    static _Thread_local double j[MAX_JOINTS][6], jt[MAX_JOINTS][6], h[N][N];
    double s[6][6], st[6][6], g[N], step[N], trial[N], mu = 1e-2, grow = 2;
    int size = 3 * n, count = 0, fresh = 1;
    double f = half_norm(n, x, j, s);
    for (; count < most; count++) {
        if (fresh) derivatives(n, exact, x, j, s, g, h);
        fresh = 0;
        double steepest = 0, predicted = 0;
        for (int p = 0; p < size; p++) steepest = fmax(steepest, fabs(g[p]));
        if (steepest < tolerance) break;
        if (solve(size, h, mu, g, step)) {
            for (int p = 0; p < size; p++) {
                trial[p] = x[p] + step[p];
                predicted += 0.5 * step[p] * (mu * step[p] - g[p]);
            }
            double ft = half_norm(n, trial, jt, st), gain = (f - ft) / predicted;
            if (gain > 1e-4) {
                double c = 2 * gain - 1;
                mu = fmax(mu * fmax(0.1, 1 - c * c * c), 1e-12);
                grow = 2; f = ft; fresh = 1;
                memcpy(x, trial, sizeof(double) * size);
                memcpy(j, jt, sizeof j);
                memcpy(s, st, sizeof s);
                continue;
            }
        }
        mu *= grow; grow *= 2;
        if (mu > 1e12) break;
    }
    for (int a = 0; a < 6; a++)
        for (int i = 0; i < n; i++) out[a * n + i] = j[i][a];
    return count;
}

/* P = (JJ' - tI)^-1; 0 where a pivot is not positive. */
static int inverse(int n, double j[][6], double t, double p[6][6]) {
    double l[6][6], r[6][6] = {{0}};
    for (int a = 0; a < 6; a++)
        for (int b = 0; b <= a; b++) {
            double sum = a == b ? -t : 0;
            for (int i = 0; i < n; i++) sum += j[i][a] * j[i][b];
            for (int k = 0; k < b; k++) sum -= l[a][k] * l[b][k];
            if (a != b) l[a][b] = sum / l[b][b];
            else if (sum <= 1e-9) return 0;
            else l[a][a] = sqrt(sum);
        }
    for (int b = 0; b < 6; b++) /* r = l^-1 */
        for (int a = b; a < 6; a++) {
            double sum = a == b;
            for (int k = b; k < a; k++) sum -= l[a][k] * r[k][b];
            r[a][b] = sum / l[a][a];
        }
    for (int a = 0; a < 6; a++)
        for (int b = 0; b <= a; b++) {
            double sum = 0;
            for (int k = a; k < 6; k++) sum += r[k][a] * r[k][b];
            p[a][b] = p[b][a] = sum;
        }
    return 1;
}

static void times(double m[6][6], const double *v, double *out) {
    for (int a = 0; a < 6; a++) out[a] = dot(m[a], v);
}

#define OUTSIDE 1e300

/* -log t - mu sum log slack_f; OUTSIDE of the feasible set. */
static double barrier(int n, double mu, const double *x, double t, double j[][6], double p[6][6],
                      double slack[]) {
    double s[6][6], w[6], sum;
    half_norm(n, x, j, s);
    if (t <= 0 || !inverse(n, j, t, p)) return OUTSIDE;
    sum = -log(t);
    for (int f = 0; f < n; f++) {
        times(p, j[f], w);
        slack[f] = 1 - dot(w, j[f]);
        if (slack[f] <= 0) return OUTSIDE;
        sum -= mu * log(slack[f]);
    }
    return sum;
}

/* Slopes a_f of the constraints, and the Hessian h of the Lagrangian with multipliers y. */
static void curvature(int n, const double *x, double t, double j[][6], double p[6][6],
                      const double *y, double slope[][N], double h[N][N]) {
    static _Thread_local double d[N][6], pd[N][6], cd[N][6], r[MAX_JOINTS][N], e[N][MAX_JOINTS];
    static _Thread_local double w[MAX_JOINTS][6], cj[MAX_JOINTS][6];
    static _Thread_local double k[MAX_JOINTS][MAX_JOINTS], q[MAX_JOINTS][MAX_JOINTS];
    double c[6][6], v[6], u[6], b[3][3], trace = 0;
    int size = 3 * n;
    slopes(n, x, j, d);
    for (int i = 0; i < n; i++) times(p, j[i], w[i]);
    for (int a = 0; a < 6; a++)
        for (int o = 0; o < 6; o++) {
            c[a][o] = 0;
            for (int i = 0; i < n; i++) c[a][o] += y[i] * w[i][a] * w[i][o];
        }
    for (int i = 0; i < n; i++) times(c, j[i], cj[i]);
    for (int i = 0; i < n; i++)
        for (int o = 0; o < n; o++) k[i][o] = dot(j[i], w[o]), q[i][o] = dot(j[i], cj[o]);
    for (int m = 0; m < size; m++) {
        times(p, d[m], pd[m]);
        times(c, d[m], cd[m]);
        for (int i = 0; i < n; i++) {
            r[i][m] = dot(w[i], d[m]);
            e[m][i] = dot(d[m], cj[i]);
            slope[i][m] = 2 * ((i == m / 3) - k[i][m / 3]) * r[i][m];
        }
    }
    for (int i = 0; i < n; i++) {
        slope[i][size] = dot(w[i], w[i]);
        times(p, w[i], v);
        times(p, cj[i], u);
        for (int a = 0; a < 6; a++) v[a] = 2 * (y[i] * v[a] - u[a]);
        times(c, w[i], u);
        for (int a = 0; a < 6; a++) v[a] -= 2 * u[a];
        for (int m = 3 * i; m < 3 * i + 3; m++) h[size][m] = dot(d[m], v);
        trace += dot(p[i % 6], c[i % 6]) * (i < 6);
    }
    h[size][size] = 1 / (t * t) + 2 * trace;
    for (int m = 0; m < size; m++)
        for (int o = 0; o <= m; o++) {
            int a = m / 3, f = o / 3;
            double both = y[a] + y[f], same = a == f;
            h[m][o] = 2 * (e[m][f] * r[a][o] + e[o][a] * r[f][m]
                           + dot(d[m], cd[o]) * (k[a][f] - same)
                           + dot(d[m], pd[o]) * (q[a][f] - both * k[a][f] + same * y[a])
                           - both * r[f][m] * r[a][o]);
        }
    for (int i = 0; i < n; i++) {
        for (int a = 0; a < 6; a++) v[a] = 2 * (y[i] * w[i][a] - cj[i][a]);
        bend(x + 3*i, j[i], v, b);
        for (int m = 0; m < 3; m++)
            for (int o = 0; o <= m; o++) h[3*i+m][3*i+o] += b[m][o];
    }
}

/* The residual first, then an interior point method on the reduced statement from a feasible t
   a little below the bound (6); where no residual is left, the bound is attained already. */
int max_min(int n, int most, double *x, double *out) {
    static _Thread_local double j[MAX_JOINTS][6], h[N][N], slope[MAX_JOINTS][N];
    double p[6][6], slack[MAX_JOINTS], y[MAX_JOINTS], g[N], step[N], trial[N], tried[MAX_JOINTS];
    double s[6][6], mu = 1e-2, least = 1e-9, t = (n - 6) / 3.0, value = OUTSIDE;
    int size = 3 * n, count = 0;
    levenberg_marquardt(n, 0, n == 7 ? 12 : 2000, 1e-7, x, out);
    if (half_norm(n, x, j, s) < 1e-13) return 0;
    while (t > 1e-6 && (value = barrier(n, mu, x, t, j, p, slack)) == OUTSIDE) t *= 0.9;
    if (value == OUTSIDE) return -1;
    for (int f = 0; f < n; f++) y[f] = mu / slack[f];
    for (; count < most; count++) {
        curvature(n, x, t, j, p, y, slope, h);
        double wrong = 0, centre = 0;
        for (int m = 0; m <= size; m++) {
            double sum = m == size ? -1 / t : 0;
            for (int f = 0; f < n; f++) sum += y[f] * slope[f][m];
            wrong = fmax(wrong, fabs(sum));
        }
        for (int f = 0; f < n; f++) centre = fmax(centre, fabs(y[f] * slack[f] - mu));
        if (fmax(wrong, centre) < 10 * mu) {
            if (mu <= least) break;
            mu = fmax(least, fmin(0.2 * mu, pow(mu, 1.5)));
            value = barrier(n, mu, x, t, j, p, slack);
        }
        for (int m = 0; m <= size; m++) {
            g[m] = m == size ? -1 / t : 0;
            for (int f = 0; f < n; f++) g[m] += mu / slack[f] * slope[f][m];
            for (int o = 0; o <= m; o++)
                for (int f = 0; f < n; f++)
                    h[m][o] += y[f] / slack[f] * slope[f][m] * slope[f][o];
        }
        double shift = 1e-8, share = 1, fall = 0, after = OUTSIDE;
        while (!solve(size + 1, h, shift, g, step)) shift = fmax(1e-4, 10 * shift);
        for (int m = 0; m <= size; m++) fall += g[m] * step[m];
        for (int tries = 0; tries < 40; tries++, share *= 0.5) {
            for (int m = 0; m < size; m++) trial[m] = x[m] + share * step[m];
            after = barrier(n, mu, trial, t + share * step[size], j, p, tried);
            if (after <= value + 1e-4 * share * fall + 1e-14) break;
        }
        if (after > value + 1e-14) break;
        for (int f = 0; f < n; f++) {
            double change = mu / slack[f] - y[f];
            for (int m = 0; m <= size; m++) change += y[f] / slack[f] * slope[f][m] * step[m];
            double whole = change < -0.99 * y[f] ? -0.99 * y[f] / change : 1;
            y[f] += whole * change;
        }
        for (int f = 0; f < n; f++) {
            slack[f] = tried[f];
            y[f] = fmin(fmax(y[f], 1e-3 * mu / slack[f]), 1e3 * mu / slack[f]);
        }
        memcpy(x, trial, sizeof(double) * size);
        t += share * step[size];
        value = after;
    }
    half_norm(n, x, j, s);
    for (int a = 0; a < 6; a++)
        for (int i = 0; i < n; i++) out[a * n + i] = j[i][a];
    return count;
}
