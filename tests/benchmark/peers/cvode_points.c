/* The scaled equations of model.py, solved with CVODE of SUNDIALS.
 *
 * usage: cvode_points METHOD BORDERS TOLERANCE PERIODS MEASURED REPEATS < POINT
 *
 * METHOD: bdf, adams (both with Newton's iteration and the dense analytic Jacobian) or adams-fixed (fixed-point
 * iteration). BORDERS: plain, or located: the borders of the backlash are found as roots and the solver starts anew
 * there. POINT: the numbers in the order in which read_point takes them. Integrates PERIODS mesh periods, then MEASURED
 * more, whose extremes of y1 are found on CVODE's own interpolant; prints one JSON line: seconds of every repeat, scaled
 * amplitude (null where CVODE gave up), the state where the measured periods begin. Exit code 2: wrong usage. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

enum { N = 8, SIZE = 2 * N, MOST_HARMONICS = 16, PIECES = 4, BISECTIONS = 40 };

typedef struct {
  /* z'' = -A z - B z' - h (c d' + k kappa f(d) - F); columns of A and B one after the other. */
  double a[N][N], b[N][N], h[N], g[N], y1[N];
  double k, c, force, static_deflection, half_backlash;
  int stiffness_count, error_count;
  double stiffness[MOST_HARMONICS][2], error[MOST_HARMONICS][2]; /* parts of sine and of cosine */
  double start[SIZE];
  int is_located, branch;
} point_type;

static void give_up(const char *why) {
  fprintf(stderr, "cvode_points: %s\n", why);
  exit(2);
}

static double number(void) {
  double value;
  if (scanf("%lf", &value) != 1) give_up("a number is missing");
  return value;
}

static void numbers(double *values, int count) {
  for (int i = 0; i < count; i++) values[i] = number();
}

static void read_point(point_type *p) {
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) p->a[j][i] = number();
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) p->b[j][i] = number();
  numbers(p->h, N);
  numbers(p->g, N);
  numbers(p->y1, N);
  p->k = number();
  p->c = number();
  p->force = number();
  p->static_deflection = number();
  p->half_backlash = number();
  p->stiffness_count = (int)number();
  p->error_count = (int)number();
  if (p->stiffness_count > MOST_HARMONICS || p->error_count > MOST_HARMONICS) give_up("too many harmonics");
  numbers(&p->stiffness[0][0], 2 * p->stiffness_count);
  numbers(&p->error[0][0], 2 * p->error_count);
  numbers(p->start, SIZE);
}

static double stiffness_at(const point_type *p, double tau) {
  double kappa = 1.0;
  for (int n = 0; n < p->stiffness_count; n++)
    kappa += p->stiffness[n][0] * sin((n + 1) * tau) + p->stiffness[n][1] * cos((n + 1) * tau);
  return p->k * kappa;
}

/* Mesh deflection d and its rate. */
static double deflection_at(const point_type *p, double tau, const double *x, double *rate) {
  double d = p->static_deflection, v = 0.0;
  for (int n = 0; n < p->error_count; n++) {
    double s = sin((n + 1) * tau), c = cos((n + 1) * tau);
    d += p->error[n][0] * s + p->error[n][1] * c;
    v += (n + 1) * (p->error[n][0] * c - p->error[n][1] * s);
  }
  for (int i = 0; i < N; i++) {
    d += p->g[i] * x[i];
    v += p->g[i] * x[N + i];
  }
  if (rate) *rate = v;
  return d;
}

/* Branch of the backlash: given where borders are located, from the deflection otherwise. */
static int branch_of(const point_type *p, double d) {
  if (p->is_located) return p->branch;
  return d >= p->half_backlash ? 1 : d <= -p->half_backlash ? -1 : 0;
}

static int right_side(realtype tau, N_Vector state, N_Vector slope, void *data) {
  const point_type *p = data;
  const double *x = NV_DATA_S(state);
  double *y = NV_DATA_S(slope), v, a[N];
  double d = deflection_at(p, tau, x, &v);
  int branch = branch_of(p, d);
  double mesh = p->c * v - p->force;
  if (branch) mesh += stiffness_at(p, tau) * (d - branch * p->half_backlash);
  for (int i = 0; i < N; i++) a[i] = -p->h[i] * mesh;
  for (int j = 0; j < N; j++)
    for (int i = 0; i < N; i++) a[i] -= p->a[j][i] * x[j] + p->b[j][i] * x[N + j];
  memcpy(y, x + N, sizeof a);
  memcpy(y + N, a, sizeof a);
  return 0;
}

static int jacobian(realtype tau, N_Vector state, N_Vector slope, SUNMatrix matrix, void *data, N_Vector t1, N_Vector t2,
                    N_Vector t3) {
  const point_type *p = data;
  double d = deflection_at(p, tau, NV_DATA_S(state), NULL);
  double k = branch_of(p, d) ? stiffness_at(p, tau) : 0.0;
  (void)slope, (void)t1, (void)t2, (void)t3;
  SUNMatZero(matrix);
  for (int j = 0; j < N; j++) {
    double *by_z = SUNDenseMatrix_Column(matrix, j), *by_v = SUNDenseMatrix_Column(matrix, N + j);
    by_v[j] = 1.0;
    for (int i = 0; i < N; i++) {
      by_z[N + i] = -p->a[j][i] - p->h[i] * k * p->g[j];
      by_v[N + i] = -p->b[j][i] - p->h[i] * p->c * p->g[j];
    }
  }
  return 0;
}

static int borders(realtype tau, N_Vector state, realtype *values, void *data) {
  const point_type *p = data;
  double d = deflection_at(p, tau, NV_DATA_S(state), NULL);
  values[0] = d - p->half_backlash;
  values[1] = d + p->half_backlash;
  return 0;
}

/* y1 or its rate from a state. */
static double observe(const point_type *p, const double *x) {
  double value = 0.0;
  for (int i = 0; i < N; i++) value += p->y1[i] * x[i];
  return value;
}

typedef struct {
  void *memory;
  point_type *point;
  N_Vector state, inside;
  double low, high; /* extremes of y1 */
} solver_type;

static void see(solver_type *s, double y) {
  s->low = fmin(s->low, y);
  s->high = fmax(s->high, y);
}

/* Extremes of y1 on the interpolant of the last step, from one time to another in it. */
static int see_step(solver_type *s, double from, double to) {
  double *x = NV_DATA_S(s->inside), previous = 0.0, at = from;
  for (int piece = 0; piece <= PIECES; piece++) {
    double t = piece == PIECES ? to : from + (to - from) * piece / PIECES;
    if (CVodeGetDky(s->memory, t, 0, s->inside)) return 1;
    double rate = observe(s->point, x + N);
    see(s, observe(s->point, x));
    if (piece && rate * previous < 0.0) {
      double low = at, high = t;
      for (int k = 0; k < BISECTIONS; k++) {
        double middle = 0.5 * (low + high);
        if (CVodeGetDky(s->memory, middle, 0, s->inside)) return 1;
        if (observe(s->point, x + N) * previous > 0.0)
          low = middle;
        else
          high = middle;
      }
      see(s, observe(s->point, x));
    }
    previous = rate;
    at = t;
  }
  return 0;
}

/* Integrate from one time to another; extremes are seen if asked for. */
static int integrate(solver_type *s, double from, double to, int is_seen) {
  double now = from;
  if (CVodeSetStopTime(s->memory, to)) return 1;
  while (now < to) {
    double before = now;
    int flag = CVode(s->memory, to, s->state, &now, is_seen ? CV_ONE_STEP : CV_NORMAL);
    if (flag < 0) return 1;
    if (is_seen && see_step(s, before, now)) return 1;
    if (flag == CV_TSTOP_RETURN) break;
    if (flag == CV_ROOT_RETURN) {
      int found[2];
      if (CVodeGetRootInfo(s->memory, found)) return 1;
      if (found[0]) s->point->branch = found[0] > 0 ? 1 : 0;
      if (found[1]) s->point->branch = found[1] > 0 ? 0 : -1;
      if (CVodeReInit(s->memory, now, s->state) || CVodeSetStopTime(s->memory, to)) return 1;
    }
  }
  return 0;
}

static double clock_now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int count, char **words) {
  if (count != 7) give_up("usage: cvode_points METHOD BORDERS TOLERANCE PERIODS MEASURED REPEATS < POINT");
  int is_bdf = !strcmp(words[1], "bdf"), is_fixed = !strcmp(words[1], "adams-fixed");
  if (!is_bdf && !is_fixed && strcmp(words[1], "adams")) give_up("unknown METHOD");
  double tolerance = atof(words[3]), period = 2.0 * acos(-1.0);
  int periods = atoi(words[4]), measured = atoi(words[5]), repeats = atoi(words[6]);
  point_type point = {0};
  point.is_located = !strcmp(words[2], "located");
  read_point(&point);

  SUNContext context;
  if (SUNContext_Create(NULL, &context)) give_up("no context");
  N_Vector state = N_VNew_Serial(SIZE, context), inside = N_VNew_Serial(SIZE, context);
  SUNMatrix matrix = SUNDenseMatrix(SIZE, SIZE, context);
  SUNLinearSolver linear = SUNLinSol_Dense(state, matrix, context);
  SUNNonlinearSolver fixed = SUNNonlinSol_FixedPoint(state, 0, context);
  double middle[SIZE];
  int failed = 0;
  solver_type s = {0};
  printf("{\"seconds\": [");
  for (int repeat = 0; repeat < repeats; repeat++) {
    double began = clock_now(), rate;
    memcpy(NV_DATA_S(state), point.start, sizeof point.start);
    double d = deflection_at(&point, 0.0, point.start, &rate), b = point.half_backlash;
    point.branch = d > b || (d == b && rate > 0.0) ? 1 : d < -b || (d == -b && rate < 0.0) ? -1 : 0;
    s = (solver_type){CVodeCreate(is_bdf ? CV_BDF : CV_ADAMS, context), &point, state, inside, INFINITY, -INFINITY};
    failed = CVodeInit(s.memory, right_side, 0.0, state) || CVodeSStolerances(s.memory, tolerance, tolerance) ||
             CVodeSetUserData(s.memory, &point) || CVodeSetMaxNumSteps(s.memory, 1000000000L);
    if (is_fixed)
      failed = failed || CVodeSetNonlinearSolver(s.memory, fixed);
    else
      failed = failed || CVodeSetLinearSolver(s.memory, linear, matrix) || CVodeSetJacFn(s.memory, jacobian);
    if (point.is_located) failed = failed || CVodeRootInit(s.memory, 2, borders);
    failed = failed || CVodeSetErrFile(s.memory, NULL);
    /* The stop at the end of the transient; time goes on, so the phase is that of the mesh. */
    failed = failed || (periods && integrate(&s, 0.0, periods * period, 0));
    memcpy(middle, NV_DATA_S(state), sizeof middle);
    failed = failed || (measured && integrate(&s, periods * period, (periods + measured) * period, 1));
    double ended = clock_now();
    CVodeFree(&s.memory);
    printf("%s%.9e", repeat ? ", " : "", ended - began);
    if (failed) break;
  }
  double amplitude = 0.5 * (s.high - s.low);
  printf("], \"amplitude\": ");
  if (failed || !isfinite(amplitude))
    printf("null");
  else
    printf("%.17e", amplitude);
  printf(", \"state\": [");
  for (int i = 0; i < SIZE; i++) printf("%s%.17e", i ? ", " : "", failed ? 0.0 : middle[i]);
  printf("]}\n");
  SUNNonlinSolFree(fixed);
  SUNLinSolFree(linear);
  SUNMatDestroy(matrix);
  N_VDestroy(state);
  N_VDestroy(inside);
  SUNContext_Free(&context);
  return 0;
}
