/* See rtds_motor.h. Every operation is one binary32 operation in the RTL's order: rtl/core/rtds_row.v for a step,
   rtds_host/motor/effect_program.py for what the effect unit prepares. Nothing may be reordered or contracted. */
#include "rtds_motor.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__FAST_MATH__)
#error "rtds_motor.c: compile without -ffast-math, which reorders operations"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "rtds_motor.c: float is evaluated in more than single precision here (x87?), use -msse2 -mfpmath=sse"
#endif
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

enum { ORIGIN_SIGNED = 128, ORIGIN_SIZE = 1 };  /* cell of an argument of zero */

/* The parameter unit's rule: a positive normal number. */
static int usable(float x) {
  uint32_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits >> 31 == 0 && (bits >> 23 & 0xFF) != 0 && (bits >> 23 & 0xFF) != 255;
}

/* R, Kb, Km, B, G11, G12, G21, G22, rho of a side; 0 when something is unusable. */
static int coefficients(const double values[RTDS_PARAMETERS], int method, float c[9]) {
  float p[RTDS_PARAMETERS];
  for (int k = 0; k < RTDS_PARAMETERS; k++) {
    if (!(values[k] > 0.0 && values[k] <= (double)FLT_MAX)) return 0;
    p[k] = (float)values[k];
    if (!usable(p[k])) return 0;
  }
  const float r = p[0], l = p[1], km = p[2], kb = p[3], j = p[4], b = p[5], h = p[6];
  const float th = h * (method ? 0.5f : 1.0f);
  const float lp = l + th * r, jp = j + th * b;
  const float cc = th * kb, d = th * km;
  const float det = lp * jp + cc * d;
  const float scale = h / det;
  c[0] = r, c[1] = kb, c[2] = km, c[3] = b;
  c[4] = scale * jp, c[5] = scale * cc, c[6] = scale * d, c[7] = scale * lp;
  c[8] = cc / lp;
  return usable(c[4]) && usable(c[5]) && usable(c[6]) && usable(c[7]);
}

static void free_step(float s[RTDS_STATES], const float c[9], float v, float t) {
  const float i = s[0], w = s[1];
  const float s1 = c[0] * i + c[1] * w;
  const float s2 = c[2] * i - c[3] * w;
  const float ti = (((s[2] - c[4] * s1) - c[5] * s2) + c[4] * v) + c[5] * t;
  const float tw = (((s[3] - c[6] * s1) + c[7] * s2) + c[6] * v) - c[7] * t;
  s[0] = i + ti;
  s[1] = w + tw;
  s[2] = ti - (s[0] - i);
  s[3] = tw - (s[1] - w);
}

/* As above, projected on what dry friction allows. */
static void friction_step(float s[RTDS_STATES], const float c[9], const float ahead[4], int prepared) {
  const float i = s[0], w = s[1];
  const float s1 = c[0] * i + c[1] * w;
  const float s2 = c[2] * i - c[3] * w;
  float ti = (s[2] - c[4] * s1) - c[5] * s2;
  float tw = (s[3] - c[6] * s1) + c[7] * s2;
  float most_f = 0.0f, most_b = 0.0f;
  if (prepared) {
    ti = (ti + c[5] * ahead[1]) + c[4] * ahead[0];
    tw = (tw - c[7] * ahead[1]) + c[6] * ahead[0];
    most_f = c[7] * ahead[2];
    most_b = c[7] * ahead[3];
  }
  const float unheld = w + tw;
  const int stuck = unheld < 0.0f ? unheld >= most_b : unheld == 0.0f || unheld <= most_f;
  const float taken = stuck ? unheld : unheld < 0.0f ? most_b : most_f;
  ti = ti + c[8] * taken;
  s[0] = i + ti;
  s[2] = ti - (s[0] - i);
  if (stuck) {
    s[1] = s[3] = 0.0f;
  } else {
    tw = tw - taken;
    s[1] = w + tw;
    s[3] = tw - (s[1] - w);
  }
}

/* The line {intercept, slope} of a table at x. */
static const float *look(const float table[RTDS_CELLS][2], float x, float k, int origin) {
  const float u = x * k;
  int cell = origin;  /* of a NaN */
  if (u >= 256.0f) {
    cell = RTDS_CELLS - 1;
  } else if (u < -256.0f) {
    cell = 0;
  } else if (u == u) {
    cell = (int)floorf(u) + origin;
    cell = cell < 0 ? 0 : cell > RTDS_CELLS - 1 ? RTDS_CELLS - 1 : cell;
  }
  return table[cell];
}

/* hi + lo + increment in two words. */
static void two_words(float *hi, float *lo, float increment) {
  const float t = increment + *lo;
  const float sum = *hi + t;
  *lo = t - (sum - *hi);
  *hi = sum;
}

/* What a side's next step works with: u_v, u_t, the level of friction forward, minus the one backward. */
static void prepare(const float s[RTDS_STATES], float draws, float vc, float t, const float c[9], const float *k,
                    const float tables[RTDS_TABLES][RTDS_CELLS][2], float inner[6], float ahead[4]) {
  const float i = s[0], w = s[1];
  const float *line;
  two_words(&inner[2], &inner[3], k[RTDS_DECLINE]);
  line = look(tables[RTDS_COMMAND], vc, k[RTDS_COMMAND_K], ORIGIN_SIGNED);
  const float bridge = (0.0f + line[0]) + line[1] * vc;
  const float scaled = (k[RTDS_NOMINAL] - inner[2]) * bridge - (k[RTDS_SAG] * bridge) * draws;
  const float limited = fabsf(scaled) > fabsf(k[RTDS_LIMIT]) ? copysignf(k[RTDS_LIMIT], scaled) : scaled;
  const float driving = limited - c[1] * w;
  line = look(tables[RTDS_DROP], driving, k[RTDS_DROP_K], ORIGIN_SIGNED);
  const float copper = c[0] * i;
  const float hot = inner[0] * copper;
  ahead[0] = ((limited - hot) - line[0]) - line[1] * driving;
  const float power = (copper + hot) * i;
  const float warmed = k[RTDS_HEAT_IN] * power - k[RTDS_HEAT_OUT] * inner[0];
  two_words(&inner[0], &inner[1], warmed);
  line = look(tables[RTDS_TORQUE], w, k[RTDS_TORQUE_K], ORIGIN_SIGNED);
  const float loaded = (t + line[0]) + line[1] * w;
  two_words(&inner[4], &inner[5], k[RTDS_PHASE] * w);
  if (inner[4] < 0.0f) {
    inner[4] = inner[4] + 1.0f;
  } else if (inner[4] >= 1.0f) {
    inner[4] = inner[4] - 1.0f;
  }
  line = look(tables[RTDS_RIPPLE], inner[4], k[RTDS_RIPPLE_K], ORIGIN_SIZE);
  ahead[1] = (loaded - line[0]) - line[1] * inner[4];
  const int negative = copysignf(1.0f, t) < 0.0f;
  const float more_f = t * k[negative ? RTDS_LOAD_DRIVEN : RTDS_LOAD_DRIVING];
  const float more_b = t * k[negative ? RTDS_LOAD_DRIVING : RTDS_LOAD_DRIVEN];
  line = look(tables[RTDS_FORWARD], w, k[RTDS_FORWARD_K], ORIGIN_SIZE);
  ahead[2] = (more_f + line[0]) + line[1] * w;
  line = look(tables[RTDS_BACKWARD], w, k[RTDS_BACKWARD_K], ORIGIN_SIZE);
  ahead[3] = (more_b - line[0]) - line[1] * w;
}

static void delay_command(rtds_pair *p, const float v[RTDS_SIDES]) {
  if (p->phase == 0) {
    const int ready = p->filled >= p->effects.delay;
    const int there = (p->at - p->effects.delay + RTDS_DELAY_ENTRIES) % RTDS_DELAY_ENTRIES;
    for (int m = 0; m < RTDS_SIDES; m++) p->memory[p->at][m] = v[m];
    for (int m = 0; m < RTDS_SIDES; m++) p->held[m] = ready ? p->memory[there][m] : 0.0f;
    p->at = (p->at + 1) % RTDS_DELAY_ENTRIES;
    if (!ready) p->filled++;
  }
  p->phase = p->phase + 1 < p->effects.stride ? p->phase + 1 : 0;
}

static void one_step(rtds_pair *p, const float v[RTDS_SIDES], const float t[RTDS_SIDES]) {
  if (!p->effects.on) {
    for (int m = 0; m < RTDS_SIDES; m++) free_step(p->state[m], p->c[m], v[m], t[m]);
    return;
  }
  for (int m = 0; m < RTDS_SIDES; m++) friction_step(p->state[m], p->c[m], p->ahead[m], p->prepared);
  delay_command(p, v);
  const float draws = p->held[0] * p->state[0][0] + p->held[1] * p->state[1][0];
  for (int m = 0; m < RTDS_SIDES; m++)
    prepare(p->state[m], draws, p->held[m], t[m], p->c[m], p->effects.constants[m],
            (const float(*)[RTDS_CELLS][2])p->effects.tables[m], p->inner[m], p->ahead[m]);
  p->prepared = 1;
}

static void rest(rtds_pair *p) {
  memset(p->ahead, 0, sizeof p->ahead);
  memset(p->inner, 0, sizeof p->inner);
  memset(p->held, 0, sizeof p->held);
  memset(p->memory, 0, sizeof p->memory);
  p->at = p->filled = p->phase = p->prepared = 0;
}

void rtds_init(rtds_pair *p) { memset(p, 0, sizeof *p); }

int rtds_set_parameters(rtds_pair *p, const double left[RTDS_PARAMETERS], const double right[RTDS_PARAMETERS],
                        int method) {
  float found[RTDS_SIDES][9];
  if (method != RTDS_BACKWARD_EULER && method != RTDS_TRAPEZOIDAL) return RTDS_BAD_ARGUMENT;
  if (left[RTDS_PARAMETERS - 1] != right[RTDS_PARAMETERS - 1]) return RTDS_BAD_ARGUMENT;
  if (!coefficients(left, method, found[0]) || !coefficients(right, method, found[1])) return RTDS_BAD_PARAMETER;
  memcpy(p->next, found, sizeof found);
  p->has_next = 1;
  return RTDS_OK;
}

int rtds_set_effects(rtds_pair *p, const rtds_effects *effects) {
  if (effects->delay < 0 || effects->delay >= RTDS_DELAY_ENTRIES || effects->stride < 1) return RTDS_BAD_ARGUMENT;
  if (!(effects->on && p->effects.on)) rest(p);
  p->effects = *effects;
  return RTDS_OK;
}

void rtds_clear(rtds_pair *p) {
  memset(p->state, 0, sizeof p->state);
  p->step_count = 0;
  rest(p);
}

int rtds_step(rtds_pair *p, const float v[RTDS_SIDES], const float t[RTDS_SIDES], uint32_t n_steps, uint32_t every,
              float (*samples)[RTDS_COLUMNS]) {
  uint32_t left = every;
  if (n_steps == 0 || every == 0) return RTDS_BAD_ARGUMENT;
  for (uint32_t done = 0; done < n_steps; done++) {
    one_step(p, v, t);
    if (done == 0 && p->has_next) {
      memcpy(p->c, p->next, sizeof p->c);
      p->has_next = 0;
    }
    if (--left == 0 || done + 1 == n_steps) {
      for (int m = 0; m < RTDS_SIDES; m++) {
        (*samples)[2 * m] = p->state[m][0];
        (*samples)[2 * m + 1] = p->state[m][1];
      }
      samples++;
      left = every;
    }
  }
  p->step_count += n_steps;
  return rtds_finite(p) ? RTDS_OK : RTDS_NOT_FINITE;
}

int rtds_finite(const rtds_pair *p) {
  for (int m = 0; m < RTDS_SIDES; m++)
    if (!isfinite(p->state[m][0]) || !isfinite(p->state[m][1])) return 0;
  return 1;
}
