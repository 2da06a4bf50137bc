/* Drive and plant of the rigid job as an FMU: FMI 2.0, co-simulation. Input: speed command, rad/s; output: motor angle, rad.
   One communication step is a scan. What a slave of this job does not need says fmi2Error. */
#include <math.h>
#include <stdlib.h>

#include "fmi2Functions.h"

typedef struct {
  double command, pos, vel, last, integral;
} Rigid;

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* functions, fmi2Boolean visible, fmi2Boolean logging) {
  (void)name, (void)type, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
  return calloc(1, sizeof(Rigid));
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
  (void)c, (void)on, (void)n, (void)names;
  return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
  (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) {
  *(Rigid*)c = (Rigid){0};
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  for (size_t k = 0; k < n; ++k) {
    if (vr[k] != 0) return fmi2Error;
    ((Rigid*)c)->command = value[k];
  }
  return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  const Rigid* s = c;
  for (size_t k = 0; k < n; ++k) value[k] = vr[k] == 0 ? s->command : s->pos;
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point, fmi2Real size, fmi2Boolean no_set_state) {
  (void)point, (void)size, (void)no_set_state;
  Rigid* s = c;
  for (int k = 0; k < CYCLES; ++k) {
    const double error = s->command - (s->pos - s->last) / CYCLE_S;
    s->last = s->pos;
    const double wanted = KVP * (error + s->integral);
    double torque = wanted;
    if (torque > TORQUE_MAX) torque = TORQUE_MAX;
    if (torque < -TORQUE_MAX) torque = -TORQUE_MAX;
    if (torque == wanted || (wanted - torque) * error < 0.0) s->integral += error * CYCLE_S / TVI;
    s->vel += CYCLE_S * (torque + ECCENTRIC * sin(s->pos / RATIO) / RATIO) / INERTIA;
    s->pos += CYCLE_S * s->vel;
  }
  return fmi2OK;
}
fmi2Status fmi2CancelStep(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

#define NOT_NEEDED(name, ...) \
  fmi2Status name(fmi2Component c, __VA_ARGS__) { return c ? fmi2Error : fmi2Fatal; }
NOT_NEEDED(fmi2SetInteger, const fmi2ValueReference v[], size_t n, const fmi2Integer x[])
NOT_NEEDED(fmi2SetBoolean, const fmi2ValueReference v[], size_t n, const fmi2Boolean x[])
NOT_NEEDED(fmi2SetString, const fmi2ValueReference v[], size_t n, const fmi2String x[])
NOT_NEEDED(fmi2GetInteger, const fmi2ValueReference v[], size_t n, fmi2Integer x[])
NOT_NEEDED(fmi2GetBoolean, const fmi2ValueReference v[], size_t n, fmi2Boolean x[])
NOT_NEEDED(fmi2GetString, const fmi2ValueReference v[], size_t n, fmi2String x[])
NOT_NEEDED(fmi2GetFMUstate, fmi2FMUstate* s)
NOT_NEEDED(fmi2SetFMUstate, fmi2FMUstate s)
NOT_NEEDED(fmi2FreeFMUstate, fmi2FMUstate* s)
NOT_NEEDED(fmi2SerializedFMUstateSize, fmi2FMUstate s, size_t* n)
NOT_NEEDED(fmi2SerializeFMUstate, fmi2FMUstate s, fmi2Byte b[], size_t n)
NOT_NEEDED(fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate* s)
NOT_NEEDED(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[],
           size_t nk, const fmi2Real du[], fmi2Real dk[])
NOT_NEEDED(fmi2SetRealInputDerivatives, const fmi2ValueReference v[], size_t n, const fmi2Integer o[],
           const fmi2Real x[])
NOT_NEEDED(fmi2GetRealOutputDerivatives, const fmi2ValueReference v[], size_t n, const fmi2Integer o[],
           fmi2Real x[])
NOT_NEEDED(fmi2GetStatus, const fmi2StatusKind k, fmi2Status* s)
NOT_NEEDED(fmi2GetRealStatus, const fmi2StatusKind k, fmi2Real* s)
NOT_NEEDED(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer* s)
NOT_NEEDED(fmi2GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean* s)
NOT_NEEDED(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String* s)
