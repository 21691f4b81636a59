/* Branch and bound for isotropic lever arms with max a_i ≤ A, in double precision without error bounds.

   See README.md for what the numbers mean and for the commands. */
#include "charts.h"

static FILE *out;
static void emit(int c) {
  if (out)
    fputc(c, out);
}
static long nnode, nleaf, nfark, nvor, nout, ncert, nparent, nstuck;
/* Half side of a cell, as a length of K, from which multipliers are computed. */
static double hsdp = 0.12;
/* Least half side of a cell with a program. */
static double smin = 0.002;
/* Half side of a cell below which the search gives up if it finds no frame in the middle. */
static double no_frame = 0.03;
static double hmin = 1e9, startT, limT;
static int capped;
/* Tree of a cell; writes one letter a node: 0 to 5 the coordinate that is cut, F no null vector, V another
   centre is nearer, O beyond the radius, P excluded by the parent's multipliers, C by its own, X given up. */
static void tree(Cell *nd) {
  if (now() - startT > limT) {
    capped = 1;
    return;
  }
  nnode++;
  if (least_distance(nd) > Hball) {
    nout++;
    nleaf++;
    emit('O');
    return;
  }
  int lk = 0;
  double size2 = 0, mx = 0, len[6];
  int okc = centre(nd);
  if (okc) {
    for (int k = 0; k < 6; k++) {
      double s = 0;
      for (int q = 0; q < 12; q++)
        s += nd->gen[k][q] * nd->gen[k][q];
      len[k] = sqrt(s);
      size2 += s;
      if (s > mx) {
        mx = s;
        lk = k;
      }
    }
  } else {
    for (int k = 0; k < 6; k++)
      if (nd->h[k] > nd->h[lk])
        lk = k;
    size2 = 1e9;
    for (int k = 0; k < 6; k++)
      len[k] = nd->h[k];
  }
  int sp = lk;
  if (okc && size2 < 1.5) {
    if (has_no_null_vector(nd, size2)) {
      nfark++;
      nleaf++;
      emit('F');
      return;
    }
    int ins;
    int v = elsewhere(nd, size2, &ins);
    if (v) {
      if (v == 1)
        nvor++;
      else
        nout++;
      nleaf++;
      emit(v == 1 ? 'V' : 'O');
      return;
    }
  } else if (nd->h[lk] < no_frame) {
    nstuck++;
    emit('X');
    return;
  }
  if (okc && sqrt(size2) < hsdp * sqrt(6)) {
    static Expansion e;
    tangent(nd->W, nd->F, &e.g);
    expansion(nd, &e);
    if (nd->m.ok && least_value(nd, &e, &nd->m, 1, 0) > 0) {
      nparent++;
      nleaf++;
      ncert++;
      emit('P');
      return;
    }
    Multipliers m;
    best_multipliers(nd->F, &e, &m);
    nsdp++;
    if (m.ok) {
      int k2 = lk;
      double f = least_value(nd, &e, &m, 0, &k2);
      if (f > 0) {
        nleaf++;
        ncert++;
        double r = sqrt(size2 / 6);
        if (r < hmin)
          hmin = r;
        emit('C');
        return;
      }
      nd->m = m;
      if (len[k2] > 0.35 * len[lk])
        sp = k2;
    } else {
      nd->m.ok = 0;
    }
    if (nd->h[sp] < smin) {
      nstuck++;
      emit('X');
      return;
    }
  }
  emit('0' + sp);
  for (int sg = -1; sg <= 1; sg += 2) {
    Cell c = *nd;
    c.h[sp] *= 0.5;
    c.tc[sp] += sg * c.h[sp];
    c.depth++;
    tree(&c);
    if (capped)
      return;
  }
}

static long shfail;
/* First frame that a shell leaves without a nearer centre. */
static double hole[12];
/* Least half side of a cell of a shell. */
static double least_shell = 0.012;
/* Every cell that meets the sphere of the radius must have a nearer centre. */
static void shell(Cell *nd) {
  nnode++;
  if (least_distance(nd) > Hball) {
    nleaf++;
    emit('O');
    return;
  }
  int lk = 0;
  double size2 = 0;
  int okc = centre(nd);
  for (int k = 0; k < 6; k++)
    if (nd->h[k] > nd->h[lk])
      lk = k;
  if (okc) {
    for (int k = 0; k < 6; k++)
      for (int q = 0; q < 12; q++)
        size2 += nd->gen[k][q] * nd->gen[k][q];
    if (size2 < 1.5) {
      int ins = 0;
      int v = elsewhere(nd, size2, &ins);
      if (v || ins) {
        nleaf++;
        emit(v == 1 ? 'V' : v == 2 ? 'O' : 'I');
        return;
      }
    }
  }
  if (nd->h[lk] < least_shell) {
    if (!shfail)
      memcpy(hole, nd->K, sizeof nd->K);
    shfail++;
    emit('X');
    return;
  }
  if (shfail >= 1)
    return;
  emit('0' + lk);
  for (int sg = -1; sg <= 1; sg += 2) {
    Cell c = *nd;
    c.h[lk] *= 0.5;
    c.tc[lk] += sg * c.h[lk];
    shell(&c);
  }
}

static void atlas(double kappa, int samples) {
  unsigned char pp[7];
  genperm(0, pp, 0);
  halves = malloc(sizeof(HalfSpace) * 2000000);
  for (int s = 0; s < samples; s++) {
    Centre z;
    sample(z.W, z.F);
    proj(z.W, z.P);
    int ok = 0;
    for (int a = nc - 1; a >= 0; a--) {
      int b;
      if (bestov(z.P, C[a].P, &b) >= 3 - kappa * kappa) {
        ok = 1;
        break;
      }
    }
    if (!ok) {
      tangent(z.W, z.F, &z.g);
      C[nc++] = z;
    }
  }
  Hball = sqrt(R2 / (1 - R2));
  printf("%d centres\n", nc);
  fflush(stdout);
}
/* Volume of all tight frames, in the length of K: 2.6 in that of W, known to 10 %. */
static const double VOLUME = 2.6 / (7. / 3 * 7. / 3 * 7. / 3);
static void run_cubes(int argc, char **v) {
  if (argc < 6) {
    fprintf(stderr, "cubes A HALF_SIDE SAMPLES SECONDS [SEED [THIRD]]\n");
    exit(2);
  }
  constants(atof(v[2]));
  double H = atof(v[3]);
  int most = atoi(v[4]);
  double seconds = atof(v[5]);
  if (argc > 6)
    rs ^= 1000003ULL * atoi(v[6]);
  if (argc > 7)
    third = atof(v[7]);
  for (int i = 0; i < 20; i++)
    uniform();
  R2 = 9;
  limT = 1e9;
  startT = now();
  double sw = 0, swn = 0, swc = 0, sws = 0, swt = 0, swt2 = 0, big = 0;
  int k = 0;
  for (; k < most && now() - startT < seconds; k++) {
    Centre *z = C;
    double w = sample(z->W, z->F);
    proj(z->W, z->P);
    tangent(z->W, z->F, &z->g);
    Cell n;
    root(&n, 0, H);
    Hball = 10;
    for (int p = 0; p < 21; p++)
      cpl[p] = 0;
    long n0 = nnode, c0 = ncert, s0 = nsdp;
    double t = now();
    tree(&n);
    t = now() - t;
    sw += w;
    swn += w * (nnode - n0);
    swc += w * (ncert - c0);
    sws += w * (nsdp - s0);
    swt += w * t;
    swt2 += w * w * t * t;
    if (w * t > big)
      big = w * t;
  }
  double cubes = VOLUME / pow(2 * H, 6);
  printf(
      "A %g: %d cubes of half side %g of %.0f; in all: nodes %.3g, cells with a certificate %.3g, programs "
      "%.3g, %.3g h (standard error %.1g), greatest share %.2f, least half side %.4f, given up %ld\n",
      limit_a, k, H, cubes, cubes * swn / sw, cubes * swc / sw, cubes * sws / sw, cubes * swt / sw / 3600,
      cubes / 3600 * sqrt(swt2 - swt * swt / k) / sw, big / swt, hmin, nstuck);
}
static void run_charts(int argc, char **v) {
  if (argc < 7) {
    fprintf(stderr, "charts A KAPPA RADIUS SAMPLES SECONDS [FILE]\n");
    exit(2);
  }
  constants(atof(v[2]));
  R2 = atof(v[4]) * atof(v[4]);
  limT = atof(v[6]);
  for (int i = 0; i < 20; i++)
    uniform();
  atlas(atof(v[3]), atoi(v[5]));
  if (argc > 7)
    out = fopen(v[7], "wb");
  startT = now();
  int a = 0;
  for (; a < nc && !capped; a++) {
    neighbours(a, 3000);
    Cell n;
    root(&n, a, Hball);
    double t = now();
    long n0 = nnode;
    emit('\n');
    tree(&n);
    if (now() - t > 5)
      printf("chart %d: %.0f s, %ld nodes\n", a, now() - t, nnode - n0), fflush(stdout);
  }
  printf(
      "A %g: %d of %d charts, %.0f s, nodes %ld, certificates %ld (of the parent %ld), no null vector %ld, "
      "nearer to another %ld, beyond the radius %ld, programs %ld, given up %ld, least half side %.4f%s\n",
      limit_a, a, nc, now() - startT, nnode, ncert, nparent, nfark, nvor, nout, nsdp, nstuck, hmin,
      capped ? ", not finished" : "");
  if (out)
    fclose(out);
}
static void run_cover(int argc, char **v) {
  if (argc < 6) {
    fprintf(stderr, "cover KAPPA RADIUS SAMPLES SECONDS\n");
    exit(2);
  }
  constants(0.06);
  R2 = atof(v[3]) * atof(v[3]);
  for (int i = 0; i < 20; i++)
    uniform();
  atlas(atof(v[2]), atoi(v[4]));
  double t0 = now();
  int first = nc, a = 0;
  for (; a < nc && now() - t0 < atof(v[5]); a++) {
    for (;;) {
      neighbours(a, 3000);
      Cell n;
      root(&n, a, Hball);
      shfail = 0;
      shell(&n);
      if (!shfail || now() - t0 > atof(v[5]))
        break;
      Centre z;
      double si[9], ri[16];
      moved(C[a].W, C[a].F, hole, z.W, z.F, si, ri);
      proj(z.W, z.P);
      tangent(z.W, z.F, &z.g);
      C[nc++] = z;
    }
  }
  printf("%d of %d shells, %d centres added, %ld nodes, %.0f s\n", a, nc, nc - first, nnode, now() - t0);
}
int main(int argc, char **v) {
  if (argc > 1 && !strcmp(v[1], "cubes"))
    run_cubes(argc, v);
  else if (argc > 1 && !strcmp(v[1], "charts"))
    run_charts(argc, v);
  else if (argc > 1 && !strcmp(v[1], "cover"))
    run_cover(argc, v);
  else {
    fprintf(stderr, "lever_tree cubes|charts|cover ...\n");
    return 2;
  }
  return 0;
}
