/* Levenberg-Marquardt for the residual of unit revolute joints, written out by hand: what the
   arithmetic itself costs. With `exact`, the Hessian is exact; else Gauss and Newton's. */
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
