/* A differential-drive robot as a model of fmu_model.h: the equations of rtds_host/export/standalone.py, in the same
   order, with inner steps of `step_s`. Wheels roll without slip, a motor is a resistance with a back EMF, dry friction
   holds or slips by impulses within their bounds (projected Gauss-Seidel, J. J. Moreau, 1988). Pairs are [left, right]. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmu_model.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

#define GRAVITY_M_S2 9.80665
#define SWEEPS 30
/* Free curves, as rtds_host/plant/forms.py has them: rows of a term, what it runs over, the ends of its grid, the time
   constant of a heat, and its values. Terms and quantities count from 1. */
#define MOST 3
#define POINTS 14
#define HALF 49
enum { TERM, OVER, LOW, HIGH, TAU, VALUES, WIDTH = VALUES + 2 * HALF };
enum { NO_TERM, TORQUE, VOLTAGE, TORQUE_CONSTANT, FORCE, YAW_TORQUE, CURRENT_SENSOR, SPEED_SENSOR, GYRO_SENSOR,
       DAMPING, TERMS };
enum { OVER_NOTHING, OVER_V, OVER_HISTORY, OVER_I, OVER_W, OVER_LOAD, OVER_RATE, OVER_TH, OVER_MOTOR, OVER_TURNS,
       OVER_SPEED, OVER_T, OVER_X, OVER_Y, OVER_YAW, OVER_HEAT, QUANTITIES };
/* What a side remembers: its command's last extreme, whether its size grows, the load of its gear, and the heat of each
   curve. */
enum { EXTREME, DIRECTION, GEAR_LOAD, HEATS, PAST = HEATS + MOST };
#define TURNS_BY 0.01
#define LOAD_S 0.01
enum { DRIVE, FORWARD, BACKWARD, FLUID, VOLTS, CONSTANT, PUSH, TURN, SCRUB, ACTS };
/* What the sensors report: v_bus, gyro_z, then i, w and th of left and right. */
enum { V_BUS, GYRO, I_L, I_R, W_L, W_R, TH_L, TH_R, CHANNELS };

typedef struct { double t, left, right; } asked_t;
typedef struct { double t, value[CHANNELS]; } seen_t;

struct fmu_model {
  double time, command[2], out[CHANNELS], x, y, yaw; /* inputs and outputs */
  double step_s, payload_kg, slope_rad, uphill_yaw_rad, start[5];
  double supply_v, source_resistance_ohm, decline_v_per_s, command_delay_s, measurement_delay_s, mass_kg;
  double yaw_inertia_kg_m2, wheel_inertia_kg_m2, track_m, com_x_m, com_y_m, slope_extra_rad, rolling, scrub_nm;
  double gyro_gain, gyro_bias_rad_s, dry_nm[2], limit_v[2], resistance_ohm[2], gear_nm_per_a[2];
  double back_emf_v_s_per_rad[2], rotor_kg_m2[2], viscous_nm_s_per_rad[2], voltage_gain[2], deadzone_v[2], drop_v[2];
  double drop_knee_a[2];
  double pwm_curve[2], heat_rise_per_w[2], heat_tau_s[2], stribeck_nm[2], stribeck_rad_s[2], asymmetry_nm[2];
  double asymmetry_nm_s_per_rad[2], load_share[2], ripple_nm[2], ripple_cycles[2], ripple_phase_rad[2], radius_m[2];
  double ripple_in_phase[2], ripple_in_quadrature[2];
  double speed_gain[2], current_gain[2], current_bias_a[2], speed_filter_s[2], speed_delay_s[2];
  double command_gain[2]; /* of a speed asked for, before the servo */
  double gear_ratio, forms[2][MOST][WIDTH];
  int32_t servo_on;
  double servo_kp_v_s_per_rad, servo_ki_v_per_rad, servo_limit_v, servo_period_s;
  /* From here on: no variables of the FMU. */
  double t, th[2], w[2], i[2], rise[2], load[2], filtered[2], bus, mass, slope, forward[2], turn[2], inertia[2][2];
  double integral[2], loop_at, loop_volts[2], acts[2][ACTS], made[2], past[2][PAST];
  int formed;
  asked_t *asked;
  seen_t *seen;
  size_t asked_room, asked_first, asked_count, seen_room, seen_first, seen_count;
};

const fmu_variable fmu_variables[] = FMU_VARIABLES;
const uint32_t fmu_variable_count = sizeof fmu_variables / sizeof *fmu_variables;
static const fmu_model START = FMU_START;

fmu_model *fmu_new(void) {
  fmu_model *m = (fmu_model *)malloc(sizeof *m);
  if (m != NULL) *m = START;
  return m;
}

void fmu_free(fmu_model *m) {
  if (m == NULL) return;
  free(m->asked);
  free(m->seen);
  free(m);
}

double *fmu_time(fmu_model *m) { return &m->time; }

double fmu_step_s(const fmu_model *m) { return m->step_s; }

static double within(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

/* Value and slope of one branch at a size of x, 0 included: the value next to the jump. */
static double branch(const double *row, int positive, double size, double *slope) {
  const double per = (HALF - 1) / row[HIGH], at = size * per;
  const int first = positive ? VALUES + HALF : VALUES + HALF - 1, way = positive ? 1 : -1;
  *slope = 0.0;
  if (at >= HALF - 1) return row[first + way * (HALF - 1)];
  const int k = (int)at;
  const double a = row[first + way * k], b = row[first + way * (k + 1)];
  *slope = (b - a) * per * way;
  return a + (b - a) * (at - k);
}

/* Value and slope of a curve at x; at a jump's place it is zero, with no slope. */
static double curve(const double *row, double x, double *slope) {
  const int over = (int)row[OVER];
  const double span = row[HIGH] - row[LOW];
  *slope = 0.0;
  if (over <= OVER_RATE) {
    if (x == 0.0 || row[HIGH] <= 0.0) return 0.0;
    return branch(row, x > 0.0, fabs(x), slope);
  }
  if (span <= 0.0) return row[VALUES];
  const int turns = over == OVER_TH || over == OVER_MOTOR || over == OVER_YAW;
  const double per = (turns ? POINTS : POINTS - 1) / span;
  double at = (x - row[LOW]) * per;
  if (turns) at -= floor(at / POINTS) * POINTS;
  else if (at <= 0.0) return row[VALUES];
  else if (at >= POINTS - 1) return row[VALUES + POINTS - 1];
  int k = (int)at;
  if (k >= POINTS) k = POINTS - 1;
  const double a = row[VALUES + k], b = k + 1 < POINTS ? row[VALUES + k + 1] : row[VALUES];
  *slope = (b - a) * per;
  return a + (b - a) * (at - k);
}

/* What the curves of side k come to; x[n] is the quantity n. */
static void act(fmu_model *m, int k, const double x[QUANTITIES]) {
  double *acts = m->acts[k], none;
  memset(acts, 0, sizeof m->acts[k]);
  for (int n = 0; n < MOST; n++) {
    const double *row = m->forms[k][n];
    const int term = (int)row[TERM], over = (int)row[OVER];
    if (term == NO_TERM) continue;
    double slope;
    const double at = over == OVER_HEAT ? m->past[k][HEATS + n] : x[over];
    const double along = over == OVER_HISTORY && x[OVER_V] < 0.0 ? -1.0 : 1.0;
    const double value = along * curve(row, at, &slope);
    if (term == TORQUE && over == OVER_LOAD) {
      acts[FORWARD] -= value;
      acts[BACKWARD] -= curve(row, -at, &none);
    } else if (term == TORQUE && over == OVER_HEAT) {
      acts[FORWARD] -= value;
      acts[BACKWARD] -= value;
    } else if (term == TORQUE && over == OVER_W) {
      acts[FORWARD] -= at > 0.0 ? value : branch(row, 1, 0.0, &none);
      acts[BACKWARD] += at < 0.0 ? value : branch(row, 0, 0.0, &none);
      acts[FLUID] -= slope;
      acts[DRIVE] -= slope * at;
    } else if (term == TORQUE) {
      acts[DRIVE] += value;
    } else if (term == VOLTAGE) {
      acts[VOLTS] += over == OVER_HEAT ? value * x[OVER_V] : value;
    } else if (term == DAMPING) {
      acts[FLUID] += value;
    } else if (term == TORQUE_CONSTANT) {
      acts[CONSTANT] += value;
    } else if (term == FORCE) {
      acts[PUSH] += value;
    } else if (term == YAW_TORQUE && over == OVER_RATE) {
      const double ahead = -branch(row, 1, 0.0, &none), back = branch(row, 0, 0.0, &none);
      const double level = at > 0.0 ? -value : at < 0.0 ? value : fmax(ahead, back);
      acts[SCRUB] += fmax(level, 0.0);
      if (level < 0.0 && at != 0.0) acts[TURN] += value;
    } else if (term == YAW_TORQUE) {
      acts[TURN] += value;
    }
  }
}

/* Follow a command, V, through its turns: whether its size grows, or has fallen back from an extreme. */
static void follow(fmu_model *m, int k, double volts) {
  double *past = m->past[k], slack = -1.0;
  for (int n = 0; n < MOST; n++) {
    const double *row = m->forms[k][n];
    if (row[TERM] != 0.0 && row[OVER] == OVER_HISTORY) slack = fmax(slack, TURNS_BY * row[HIGH]);
  }
  if (slack < 0.0) return;
  const double size = fabs(volts), extreme = fabs(past[EXTREME]);
  if (volts * past[EXTREME] < 0.0 || past[DIRECTION] == 0.0) {
    past[EXTREME] = volts;
    if (size > 0.0) past[DIRECTION] = 1.0;
  } else if (past[DIRECTION] > 0.0) {
    if (size < extreme - slack) past[DIRECTION] = -1.0;
    if (size > extreme || past[DIRECTION] < 0.0) past[EXTREME] = volts;
  } else {
    if (size > extreme + slack) past[DIRECTION] = 1.0;
    if (size < extreme || past[DIRECTION] > 0.0) past[EXTREME] = volts;
  }
}

/* What the curves of side k add to a sensor's reading of x. */
static double reads(const fmu_model *m, int k, int term, int over, double x) {
  double total = 0.0, slope;
  for (int n = 0; n < MOST; n++)
    if (m->forms[k][n][TERM] == term && m->forms[k][n][OVER] == over) total += curve(m->forms[k][n], x, &slope);
  return total;
}

/* The current that curves of voltage over the current allow: ohm i - f(i) is what else drives. */
static double settled(fmu_model *m, int k) {
  const double ohm = m->resistance_ohm[k] * (1.0 + m->rise[k]);
  double most = 0.0;
  int there = 0;
  for (int n = 0; n < MOST; n++) {
    const double *row = m->forms[k][n];
    there = there || (row[TERM] == VOLTAGE && row[OVER] == OVER_I);
    for (int j = VALUES; j < WIDTH; j++) most += fabs(row[j]);
  }
  if (!there) return m->i[k];
  const double free = ohm * m->i[k] - m->made[k];
  double high = (fabs(free) + most) / ohm, low = -high;
  for (int n = 0; n < 48; n++) {
    const double middle = 0.5 * (low + high);
    if (ohm * middle - reads(m, k, VOLTAGE, OVER_I, middle) < free) low = middle; else high = middle;
  }
  m->made[k] = reads(m, k, VOLTAGE, OVER_I, 0.5 * (low + high));
  return 0.5 * (low + high);
}

static double rate_of(const fmu_model *m) { return m->turn[0] * m->w[0] + m->turn[1] * m->w[1]; }

static void push_seen(fmu_model *m) {
  if (m->seen_count == m->seen_room) {
    m->seen_first = (m->seen_first + 1) % m->seen_room;
    m->seen_count--;
  }
  seen_t *s = &m->seen[(m->seen_first + m->seen_count++) % m->seen_room];
  s->t = m->t;
  s->value[V_BUS] = m->bus;
  s->value[GYRO] = rate_of(m) * m->gyro_gain + m->gyro_bias_rad_s;
  s->value[GYRO] += reads(m, 0, GYRO_SENSOR, OVER_RATE, s->value[GYRO]) + reads(m, 0, GYRO_SENSOR, OVER_T, m->t);
  for (int k = 0; k < 2; k++) {
    const double speed = m->speed_filter_s[k] > 0.0 ? m->filtered[k] : m->w[k];
    s->value[I_L + k] = m->i[k] * m->current_gain[k] + m->current_bias_a[k];
    s->value[W_L + k] = speed * m->speed_gain[k];
    s->value[I_L + k] += reads(m, k, CURRENT_SENSOR, OVER_I, s->value[I_L + k]);
    s->value[W_L + k] += reads(m, k, SPEED_SENSOR, OVER_W, s->value[W_L + k]);
    s->value[TH_L + k] = m->start[3 + k] + (m->th[k] - m->start[3 + k]) * m->speed_gain[k];
  }
}

static void push_asked(fmu_model *m, double t, double left, double right) {
  if (m->asked_count == m->asked_room) {
    m->asked_first = (m->asked_first + 1) % m->asked_room;
    m->asked_count--;
  }
  asked_t *a = &m->asked[(m->asked_first + m->asked_count++) % m->asked_room];
  a->t = t, a->left = left, a->right = right;
}

/* A channel as it was so many seconds before, between two inner steps in proportion. */
static double seen_before(const fmu_model *m, int channel, double late) {
  const double at = m->t - late;
  size_t low = 0, high = m->seen_count - 1; /* the first entry at or after `at`, or the last one */
  while (low < high) {
    const size_t middle = (low + high) / 2;
    if (m->seen[(m->seen_first + middle) % m->seen_room].t >= at) high = middle; else low = middle + 1;
  }
  if (low == 0 && m->seen_count > 1) low = 1;
  const seen_t *b = &m->seen[(m->seen_first + low) % m->seen_room];
  const seen_t *a = low > 0 ? &m->seen[(m->seen_first + low - 1) % m->seen_room] : b;
  const double share = b->t <= a->t ? 1.0 : within((at - a->t) / (b->t - a->t), 0.0, 1.0);
  return (1.0 - share) * a->value[channel] + share * b->value[channel];
}

static void report(fmu_model *m) {
  for (int n = 0; n < CHANNELS; n++) {
    const double more = n == W_L || n == W_R ? m->speed_delay_s[n - W_L] : 0.0;
    m->out[n] = seen_before(m, n, m->measurement_delay_s + more);
  }
}

static const char *check(const fmu_model *m) {
  if (!(m->step_s > 0.0)) return "step_s: is to be greater than zero";
  if (!(m->mass_kg + m->payload_kg > 0.0)) return "mass_kg, payload_kg: together they are to be greater than zero";
  if (!(m->track_m > 0.0 && m->supply_v > 0.0)) return "track_m, supply_v: are to be greater than zero";
  for (int k = 0; k < 2; k++) {
    if (!(m->resistance_ohm[k] > 0.0 && m->radius_m[k] > 0.0)) return "resistance_ohm, radius_m: are to be greater than zero";
    if (m->heat_rise_per_w[k] != 0.0 && !(m->heat_tau_s[k] > 0.0)) return "heat_tau_s: is to be greater than zero";
    if (m->stribeck_nm[k] != 0.0 && !(m->stribeck_rad_s[k] > 0.0)) return "stribeck_rad_s: is to be greater than zero";
    if (!(m->speed_delay_s[k] >= 0.0)) return "speed_delay_s: is to be zero or greater";
  }
  if (!(m->command_delay_s >= 0.0 && m->measurement_delay_s >= 0.0)) return "a delay is to be zero or greater";
  if (m->servo_on && !(m->servo_period_s > 0.0)) return "servo_period_s: is to be greater than zero";
  return NULL;
}

const char *fmu_initialise(fmu_model *m) {
  const char *why = check(m);
  if (why != NULL) return why;
  m->bus = m->supply_v;
  m->formed = 0;
  memset(m->acts, 0, sizeof m->acts);
  memset(m->past, 0, sizeof m->past);
  m->made[0] = m->made[1] = 0.0;
  for (int k = 0; k < 2; k++)
    for (int n = 0; n < MOST; n++) {
      const double *row = m->forms[k][n];
      if (!(row[TERM] >= 0.0 && row[TERM] < TERMS && row[OVER] >= 0.0 && row[OVER] < QUANTITIES))
        return "form: no such term or quantity";
      if (row[TERM] != 0.0 && row[OVER] < 1.0) return "form: a term needs a quantity";
      if (row[TERM] != 0.0 && row[OVER] == OVER_HEAT && !(row[TAU] > 0.0)) return "form: a heat needs a time constant";
      m->formed = m->formed || row[TERM] != 0.0;
    }
  m->mass = m->mass_kg + m->payload_kg;
  m->slope = m->slope_rad + m->slope_extra_rad;
  m->x = m->start[0], m->y = m->start[1], m->yaw = m->start[2];
  const double mass = m->mass, my = -m->mass * m->com_y_m, iz = m->yaw_inertia_kg_m2;
  for (int k = 0; k < 2; k++) {
    m->th[k] = m->start[3 + k];
    m->forward[k] = 0.5 * m->radius_m[k];
    m->turn[k] = (k ? m->radius_m[k] : -m->radius_m[k]) / m->track_m;
  }
  const double *f = m->forward, *g = m->turn;
  for (int j = 0; j < 2; j++)
    for (int k = 0; k < 2; k++)
      m->inertia[j][k] = mass * f[j] * f[k] + my * (f[j] * g[k] + g[j] * f[k]) + iz * g[j] * g[k] +
                         (j == k ? m->rotor_kg_m2[k] + m->wheel_inertia_kg_m2 : 0.0);
  if (!(m->inertia[0][0] * m->inertia[1][1] > m->inertia[0][1] * m->inertia[1][0])) return "the robot has no inertia";
  const double latest = m->measurement_delay_s + fmax(m->speed_delay_s[0], m->speed_delay_s[1]);
  m->asked_room = (size_t)ceil(m->command_delay_s / m->step_s) + 4;
  m->seen_room = (size_t)ceil(latest / m->step_s) + 4;
  free(m->asked);
  free(m->seen);
  m->asked_first = m->asked_count = m->seen_first = m->seen_count = 0;
  m->asked = (asked_t *)calloc(m->asked_room, sizeof *m->asked);
  m->seen = (seen_t *)calloc(m->seen_room, sizeof *m->seen);
  if (m->asked == NULL || m->seen == NULL) return "no memory for the delays";
  push_asked(m, 0.0, 0.0, 0.0);
  push_seen(m);
  report(m);
  return NULL;
}

/* The voltages that act now: late ones, or those by which the servo follows late speeds. */
static void command_now(fmu_model *m, double volts[2]) {
  const double at = m->t - m->command_delay_s + 1e-9;
  while (m->asked_count > 1 && m->asked[(m->asked_first + 1) % m->asked_room].t <= at) {
    m->asked_first = (m->asked_first + 1) % m->asked_room;
    m->asked_count--;
  }
  const asked_t *a = &m->asked[m->asked_first];
  const double asked[2] = {a->left, a->right};
  if (!m->servo_on) {
    volts[0] = asked[0], volts[1] = asked[1];
    return;
  }
  if (m->loop_at <= m->t + 1e-9) {
    const double top = m->servo_limit_v;
    for (int k = 0; k < 2; k++) {
      const double told = m->w[k] * m->speed_gain[k];
      const double miss = asked[k] * m->command_gain[k] - told - reads(m, k, SPEED_SENSOR, OVER_W, told);
      m->integral[k] = within(m->integral[k] + m->servo_ki_v_per_rad * miss * m->servo_period_s, -top, top);
      m->loop_volts[k] = within(m->servo_kp_v_s_per_rad * miss + m->integral[k], -top, top);
    }
    while (m->loop_at <= m->t + 1e-9) m->loop_at += m->servo_period_s;
  }
  volts[0] = m->loop_volts[0], volts[1] = m->loop_volts[1];
}

/* What the driver makes of a command, before the bus and its limit. */
static double driver(const fmu_model *m, double asked, int k) {
  const double top = m->supply_v;
  double v = within(asked, -top, top);
  v *= 1.0 + m->pwm_curve[k] * (1.0 - fabs(v) / top);
  return m->voltage_gain[k] * (v - copysign(fmin(fabs(v), m->deadzone_v[k]), v));
}

/* A bound on motion in a direction of (w_l, w_r): an impulse between low and high; move is what one of it changes. */
typedef struct { double way[2], low, high, move[2], impulse; int wheel; } bound_t;

static int bounds_of(const fmu_model *m, double h, bound_t *b) {
  int n = 0;
  for (int k = 0; k < 3; k++) {
    double f, g;
    if (k < 2) {
      double level = m->dry_nm[k] + m->rolling * m->mass * GRAVITY_M_S2 * 0.5 * m->radius_m[k];
      if (m->stribeck_nm[k] != 0.0) {
        const double s = m->w[k] / m->stribeck_rad_s[k];
        level += m->stribeck_nm[k] * exp(-(s * s));
      }
      level += m->load_share[k] * m->load[k];
      f = level + m->asymmetry_nm[k] + m->acts[k][FORWARD], g = level - m->asymmetry_nm[k] + m->acts[k][BACKWARD];
    } else {
      f = g = m->scrub_nm + m->acts[0][SCRUB];
    }
    if (f == 0.0 && g == 0.0) continue;
    b[n].way[0] = k == 2 ? m->turn[0] : k == 0;
    b[n].way[1] = k == 2 ? m->turn[1] : k == 1;
    b[n].low = fmin(-h * f, h * g), b[n].high = fmax(-h * f, h * g);
    b[n].impulse = 0.0, b[n].wheel = k;
    n++;
  }
  return n;
}

/* Speeds at the end of a step, and the impulses of dry friction at both wheels: a new = b + impulses. */
static void slip(const fmu_model *m, double a[2][2], const double b[2], double h, double now[2], double at_wheels[2]) {
  const double determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
  const double inverse[2][2] = {{a[1][1] / determinant, -a[0][1] / determinant},
                                {-a[1][0] / determinant, a[0][0] / determinant}};
  bound_t bounds[3];
  const int count = bounds_of(m, h, bounds);
  for (int j = 0; j < 2; j++) {
    now[j] = inverse[j][0] * b[0] + inverse[j][1] * b[1];
    at_wheels[j] = 0.0;
    for (int n = 0; n < count; n++)
      bounds[n].move[j] = inverse[j][0] * bounds[n].way[0] + inverse[j][1] * bounds[n].way[1];
  }
  for (int sweep = 0; sweep < SWEEPS && count > 0; sweep++) {
    double changed = 0.0;
    for (int n = 0; n < count; n++) {
      bound_t *c = &bounds[n];
      const double give = c->way[0] * c->move[0] + c->way[1] * c->move[1];
      const double slides = c->way[0] * now[0] + c->way[1] * now[1];
      const double wanted = within(c->impulse - slides / give, c->low, c->high);
      const double change = wanted - c->impulse;
      c->impulse = wanted;
      for (int j = 0; j < 2; j++) now[j] = now[j] + c->move[j] * change;
      changed = fmax(changed, fabs(change) * give);
    }
    if (changed < 1e-12) break;
  }
  for (int n = 0; n < count; n++)
    if (bounds[n].wheel < 2) at_wheels[bounds[n].wheel] = bounds[n].impulse;
}

/* What bridge and brushes drop of a voltage u; soft: the knee's current times the resistance. */
static double dropped(double u, double drop, double soft) {
  if (drop <= 0.0 || soft <= 0.0) return within(u, -drop, drop);
  const double x = u / (drop + soft), bend = 0.22 * soft / (drop + soft);
  return 0.5 * drop * (sqrt((x + 1.0) * (x + 1.0) + bend) - sqrt((x - 1.0) * (x - 1.0) + bend));
}

/* What side k adds to the half implicit step: damping to a, impulse to b. */
static void drive(fmu_model *m, const double asked[2], int k, double h, double a[2][2], double b[2], double *volts,
                  double *ohm, double *fluid, double *extra) {
  /* What changes the torque of a current changes the back-EMF of a speed by the same share. */
  const double ke = m->back_emf_v_s_per_rad[k] * (1.0 + m->acts[k][CONSTANT]), limit = m->limit_v[k];
  const double u = within((driver(m, asked[k], k) + m->acts[k][VOLTS]) * m->bus / m->supply_v, -limit, limit);
  *volts = u - dropped(u - ke * m->w[k], m->drop_v[k], m->drop_knee_a[k] * m->resistance_ohm[k]);
  *ohm = m->resistance_ohm[k] * (1.0 + m->rise[k]);
  *fluid = m->viscous_nm_s_per_rad[k] + copysign(m->asymmetry_nm_s_per_rad[k], m->w[k]) +
           m->acts[k][FLUID];
  const double gear = m->gear_nm_per_a[k] * (1.0 + m->acts[k][CONSTANT]);
  const double damping = gear * ke / *ohm + *fluid;
  const double at = m->ripple_cycles[k] * (m->th[k] + 0.5 * h * m->w[k]) + m->ripple_phase_rad[k];
  const double ripple =
      m->ripple_nm[k] * (sin(at) + m->ripple_in_phase[k] * sin(2.0 * at) + m->ripple_in_quadrature[k] * cos(2.0 * at));
  *extra = ripple + m->acts[k][DRIVE];
  a[k][k] += 0.5 * h * damping;
  b[k] += h * (gear * *volts / *ohm + *extra - 0.5 * damping * m->w[k]);
}

/* Current, heat, load and reported speed of side k after the step. */
static void settle(fmu_model *m, int k, double h, double now, double volts, double ohm, double fluid, double extra,
                   double impulse) {
  const double ke = m->back_emf_v_s_per_rad[k] * (1.0 + m->acts[k][CONSTANT]);
  const double w = m->w[k], tau = m->speed_filter_s[k];
  const double mean = 0.5 * (w + now);
  const double current = (volts - ke * mean) / ohm;
  m->i[k] = (volts - ke * now) / ohm;
  if (m->heat_rise_per_w[k] != 0.0)
    m->rise[k] += h * (m->heat_rise_per_w[k] * current * current * ohm - m->rise[k]) / m->heat_tau_s[k];
  const double gear = m->gear_nm_per_a[k] * (1.0 + m->acts[k][CONSTANT]);
  const double torque = gear * current - fluid * mean - m->rotor_kg_m2[k] * (now - w) / h;
  m->load[k] = fmax(fabs(torque), fabs(torque + impulse / h));
  if (m->formed) {
    const double delivered = torque + extra + impulse / h;
    m->past[k][GEAR_LOAD] += (delivered - m->past[k][GEAR_LOAD]) * (1.0 - exp(-h / LOAD_S));
    for (int n = 0; n < MOST; n++) {
      const double *row = m->forms[k][n];
      double *heat = &m->past[k][HEATS + n];
      if (row[TERM] != 0.0 && row[OVER] == OVER_HEAT) *heat += (current * current - *heat) * (1.0 - exp(-h / row[TAU]));
    }
  }
  if (tau > 0.0) {
    const double ramp = (now - w) / h;
    m->filtered[k] = now - ramp * tau + (m->filtered[k] - w + ramp * tau) * exp(-h / tau);
  }
  m->th[k] += h * mean;
}

static void advance(fmu_model *m, double h) {
  double asked[2], a[2][2], b[2], volts[2], ohm[2], fluid[2], extra[2], now[2], impulses[2];
  const double *w = m->w, *f = m->forward, *g = m->turn, top = m->supply_v;
  command_now(m, asked);
  const double draw = (m->i[0] * within(asked[0], -top, top) + m->i[1] * within(asked[1], -top, top)) / top;
  m->bus = top - m->decline_v_per_s * m->t - m->source_resistance_ohm * draw;
  if (m->formed)
    for (int k = 0; k < 2; k++) {
      const double turns = rate_of(m), moves = f[0] * w[0] + f[1] * w[1], angle = m->th[k] + 0.5 * h * w[k];
      const double volts_now = within(asked[k], -top, top);
      follow(m, k, volts_now);
      const double x[QUANTITIES] = {0.0,
                                    volts_now,
                                    m->past[k][DIRECTION] * fabs(volts_now),
                                    settled(m, k),
                                    w[k],
                                    m->past[k][GEAR_LOAD],
                                    turns,
                                    angle,
                                    m->gear_ratio * angle,
                                    moves * turns,
                                    moves,
                                    m->t,
                                    m->x,
                                    m->y,
                                    m->yaw,
                                    0.0};
      act(m, k, x);
    }
  memcpy(a, m->inertia, sizeof a);
  for (int j = 0; j < 2; j++) b[j] = a[j][0] * w[0] + a[j][1] * w[1];
  for (int k = 0; k < 2; k++) drive(m, asked, k, h, a, b, &volts[k], &ohm[k], &fluid[k], &extra[k]);
  const double speed = f[0] * w[0] + f[1] * w[1], rate = rate_of(m);
  const double heading = m->yaw + 0.5 * h * rate - m->uphill_yaw_rad;
  const double pull = m->mass * GRAVITY_M_S2 * sin(m->slope);
  const double mx = m->mass * m->com_x_m;
  const double push = mx * rate * rate - pull * cos(heading) + m->acts[0][PUSH];
  const double twist = -mx * speed * rate + pull * (m->com_x_m * sin(heading) + m->com_y_m * cos(heading)) +
                       m->acts[0][TURN];
  for (int k = 0; k < 2; k++) b[k] += h * (f[k] * push + g[k] * twist);
  slip(m, a, b, h, now, impulses);
  for (int k = 0; k < 2; k++) settle(m, k, h, now[k], volts[k], ohm[k], fluid[k], extra[k], impulses[k]);
  const double after = g[0] * now[0] + g[1] * now[1];
  const double middle = m->yaw + 0.25 * h * (rate + after);
  const double way = 0.5 * h * (speed + f[0] * now[0] + f[1] * now[1]);
  m->x += way * cos(middle);
  m->y += way * sin(middle);
  m->yaw += 0.5 * h * (rate + after);
  m->w[0] = now[0], m->w[1] = now[1];
  m->t += h;
  push_seen(m);
}

const char *fmu_steps(fmu_model *m, uint64_t n) {
  if (!isfinite(m->command[0]) || !isfinite(m->command[1])) return "an input is not finite";
  push_asked(m, m->t, m->command[0], m->command[1]);
  for (uint64_t k = 0; k < n; k++) advance(m, m->step_s);
  report(m);
  return isfinite(m->x) && isfinite(m->w[0]) && isfinite(m->w[1]) ? NULL : "the robot's state is no longer finite";
}
