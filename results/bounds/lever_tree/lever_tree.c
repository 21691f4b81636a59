/* Branch and bound for isotropic lever arms with max a_i ≤ A, in double precision without error bounds.

   See README.md for what the numbers mean and for the commands. */
#include "charts.h"

static FILE *out;
static void emit(int c) {
  if (out)
    fputc(c, out);
}
static long node_count, leaf_count, no_null_count, nearer_count, beyond_count, certificate_count,
    parent_count, given_up_count;
/* Half side of a cell, as a length of K, from which multipliers are computed. */
static double program_size = 0.12;
/* Least half side of a cell with a program. */
static double least_side = 0.002;
/* Half side of a cell below which the search gives up if it finds no frame in the middle. */
static double no_frame = 0.03;
static double least_radius = 1e9, start_time, time_limit;
static int capped;
/* Tree of a cell; writes one letter a node: 0 to 5 the coordinate that is cut, F no null vector, V another
   centre is nearer, O beyond the radius, P excluded by the parent's multipliers, C by its own, X given up. */
static void tree(Cell *cell) {
  if (now() - start_time > time_limit) {
    capped = 1;
    return;
  }
  node_count++;
  if (least_distance(cell) > greatest_t) {
    beyond_count++;
    leaf_count++;
    emit('O');
    return;
  }
  int lk = 0;
  double size2 = 0, mx = 0, len[6];
  int okc = centre(cell);
  if (okc) {
    for (int k = 0; k < 6; k++) {
      double s = 0;
      for (int q = 0; q < 12; q++)
        s += cell->gen[k][q] * cell->gen[k][q];
      len[k] = sqrt(s);
      size2 += s;
      if (s > mx) {
        mx = s;
        lk = k;
      }
    }
  } else {
    for (int k = 0; k < 6; k++)
      if (cell->h[k] > cell->h[lk])
        lk = k;
    size2 = 1e9;
    for (int k = 0; k < 6; k++)
      len[k] = cell->h[k];
  }
  int sp = lk;
  if (okc && size2 < 1.5) {
    if (has_no_null_vector(cell, size2)) {
      no_null_count++;
      leaf_count++;
      emit('F');
      return;
    }
    int ins;
    int v = elsewhere(cell, size2, &ins);
    if (v) {
      if (v == 1)
        nearer_count++;
      else
        beyond_count++;
      leaf_count++;
      emit(v == 1 ? 'V' : 'O');
      return;
    }
  } else if (cell->h[lk] < no_frame) {
    given_up_count++;
    emit('X');
    return;
  }
  if (okc && sqrt(size2) < program_size * sqrt(6)) {
    static Expansion e;
    tangent(cell->W, cell->F, &e.g);
    expansion(cell, &e);
    if (cell->m.ok && least_value(cell, &e, &cell->m, 1, 0) > 0) {
      parent_count++;
      leaf_count++;
      certificate_count++;
      emit('P');
      return;
    }
    Multipliers m;
    best_multipliers(cell->F, &e, &m);
    program_count++;
    if (m.ok) {
      int k2 = lk;
      double f = least_value(cell, &e, &m, 0, &k2);
      if (f > 0) {
        leaf_count++;
        certificate_count++;
        double r = sqrt(size2 / 6);
        if (r < least_radius)
          least_radius = r;
        emit('C');
        return;
      }
      cell->m = m;
      if (len[k2] > 0.35 * len[lk])
        sp = k2;
    } else {
      cell->m.ok = 0;
    }
    if (cell->h[sp] < least_side) {
      given_up_count++;
      emit('X');
      return;
    }
  }
  emit('0' + sp);
  for (int sg = -1; sg <= 1; sg += 2) {
    Cell c = *cell;
    c.h[sp] *= 0.5;
    c.tc[sp] += sg * c.h[sp];
    c.depth++;
    tree(&c);
    if (capped)
      return;
  }
}

static long uncovered_count;
/* First frame that a shell leaves without a nearer centre. */
static double hole[12];
/* Least half side of a cell of a shell. */
static double least_shell = 0.012;
/* Every cell that meets the sphere of the radius must have a nearer centre. */
static void shell(Cell *cell) {
  node_count++;
  if (least_distance(cell) > greatest_t) {
    leaf_count++;
    emit('O');
    return;
  }
  int lk = 0;
  double size2 = 0;
  int okc = centre(cell);
  for (int k = 0; k < 6; k++)
    if (cell->h[k] > cell->h[lk])
      lk = k;
  if (okc) {
    for (int k = 0; k < 6; k++)
      for (int q = 0; q < 12; q++)
        size2 += cell->gen[k][q] * cell->gen[k][q];
    if (size2 < 1.5) {
      int ins = 0;
      int v = elsewhere(cell, size2, &ins);
      if (v || ins) {
        leaf_count++;
        emit(v == 1 ? 'V' : v == 2 ? 'O' : 'I');
        return;
      }
    }
  }
  if (cell->h[lk] < least_shell) {
    if (!uncovered_count)
      memcpy(hole, cell->K, sizeof cell->K);
    uncovered_count++;
    emit('X');
    return;
  }
  if (uncovered_count >= 1)
    return;
  emit('0' + lk);
  for (int sg = -1; sg <= 1; sg += 2) {
    Cell c = *cell;
    c.h[lk] *= 0.5;
    c.tc[lk] += sg * c.h[lk];
    shell(&c);
  }
}

static void atlas(double kappa, int samples) {
  unsigned char pp[7];
  all_orders(0, pp, 0);
  halves = malloc(sizeof(HalfSpace) * 2000000);
  for (int s = 0; s < samples; s++) {
    Centre z;
    sample(z.W, z.F);
    projector(z.W, z.P);
    int ok = 0;
    for (int a = centre_count - 1; a >= 0; a--) {
      int b;
      if (best_overlap(z.P, C[a].P, &b) >= 3 - kappa * kappa) {
        ok = 1;
        break;
      }
    }
    if (!ok) {
      tangent(z.W, z.F, &z.g);
      C[centre_count++] = z;
    }
  }
  greatest_t = sqrt(radius_squared / (1 - radius_squared));
  printf("%d centres\n", centre_count);
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
    random_state ^= 1000003ULL * atoi(v[6]);
  if (argc > 7)
    third_order = atof(v[7]);
  for (int i = 0; i < 20; i++)
    uniform();
  radius_squared = 9;
  time_limit = 1e9;
  start_time = now();
  double sw = 0, swn = 0, swc = 0, sws = 0, swt = 0, swt2 = 0, big = 0;
  int k = 0;
  for (; k < most && now() - start_time < seconds; k++) {
    Centre *z = C;
    double w = sample(z->W, z->F);
    projector(z->W, z->P);
    tangent(z->W, z->F, &z->g);
    Cell n;
    root(&n, 0, H);
    greatest_t = 10;
    for (int p = 0; p < 21; p++)
      centre_pairs[p] = 0;
    long n0 = node_count, c0 = certificate_count, s0 = program_count;
    double t = now();
    tree(&n);
    t = now() - t;
    sw += w;
    swn += w * (node_count - n0);
    swc += w * (certificate_count - c0);
    sws += w * (program_count - s0);
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
      cubes / 3600 * sqrt(swt2 - swt * swt / k) / sw, big / swt, least_radius, given_up_count);
}
static void run_charts(int argc, char **v) {
  if (argc < 7) {
    fprintf(stderr, "charts A KAPPA RADIUS SAMPLES SECONDS [FILE]\n");
    exit(2);
  }
  constants(atof(v[2]));
  radius_squared = atof(v[4]) * atof(v[4]);
  time_limit = atof(v[6]);
  for (int i = 0; i < 20; i++)
    uniform();
  atlas(atof(v[3]), atoi(v[5]));
  if (argc > 7)
    out = fopen(v[7], "wb");
  start_time = now();
  int a = 0;
  for (; a < centre_count && !capped; a++) {
    neighbours(a, 3000);
    Cell n;
    root(&n, a, greatest_t);
    double t = now();
    long n0 = node_count;
    emit('\n');
    tree(&n);
    if (now() - t > 5)
      printf("chart %d: %.0f s, %ld nodes\n", a, now() - t, node_count - n0), fflush(stdout);
  }
  printf(
      "A %g: %d of %d charts, %.0f s, nodes %ld, certificates %ld (of the parent %ld), no null vector %ld, "
      "nearer to another %ld, beyond the radius %ld, programs %ld, given up %ld, least half side %.4f%s\n",
      limit_a, a, centre_count, now() - start_time, node_count, certificate_count, parent_count,
      no_null_count, nearer_count, beyond_count, program_count, given_up_count, least_radius,
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
  radius_squared = atof(v[3]) * atof(v[3]);
  for (int i = 0; i < 20; i++)
    uniform();
  atlas(atof(v[2]), atoi(v[4]));
  double t0 = now();
  int first = centre_count, a = 0;
  for (; a < centre_count && now() - t0 < atof(v[5]); a++) {
    for (;;) {
      neighbours(a, 3000);
      Cell n;
      root(&n, a, greatest_t);
      uncovered_count = 0;
      shell(&n);
      if (!uncovered_count || now() - t0 > atof(v[5]))
        break;
      Centre z;
      double si[9], ri[16];
      moved(C[a].W, C[a].F, hole, z.W, z.F, si, ri);
      projector(z.W, z.P);
      tangent(z.W, z.F, &z.g);
      C[centre_count++] = z;
    }
  }
  printf("%d of %d shells, %d centres added, %ld nodes, %.0f s\n", a, centre_count, centre_count - first,
         node_count, now() - t0);
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
