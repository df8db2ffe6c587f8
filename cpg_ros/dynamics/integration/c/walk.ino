/* Walk with hobby servos, one for each joint. The wiring is an example; nobody has run it on a
 * robot. Lift the robot off the ground first. */
#include <Servo.h>
#include <cpg.h>

static const unsigned long TICK = @TICK@;  /* ms */
/* @JOINTS@ */
static const uint8_t PINS[CPG_JOINTS] = {@PINS@};
/* Degrees of each servo at 0 rad, and which way it turns: to be measured on the robot. */
static const int8_t CENTRE = 90, DIRECTION[CPG_JOINTS] = {@ONES@};

static Servo servos[CPG_JOINTS];
static cpg gait;
static unsigned long next_tick;

static void write_servos()
{
    for (uint8_t joint = 0; joint < CPG_JOINTS; joint++) {
#ifdef CPG_FIXED
        const int tenths = CENTRE * 10 + DIRECTION[joint] * CPG_TENTHS(gait.position[joint]);
#else
        const int tenths = CENTRE * 10 + DIRECTION[joint] * int(gait.position[joint] * 572.9578);
#endif
        servos[joint].write(tenths < 0 ? 0 : tenths > 1800 ? 180 : (tenths + 5) / 10);
    }
}

void setup()
{
    cpg_start(&gait, 0, @RAMP@);
    for (uint8_t joint = 0; joint < CPG_JOINTS; joint++) {
        servos[joint].attach(PINS[joint]);
    }
    write_servos();
    delay(2000);
    next_tick = millis();
}

void loop()
{
    if ((long)(millis() - next_tick) >= 0) {
        next_tick += TICK;
        cpg_advance(&gait@TIME@);
        write_servos();
    }
}
