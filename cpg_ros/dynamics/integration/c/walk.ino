/* Walk with hobby servos, one for each joint. The wiring is an example; nobody has run it on a
 * robot. Lift the robot off the ground first. */
#include <Servo.h>
#include <cpg.h>

static const unsigned long TICK = @TICK@;  /* ms */
/* @JOINTS@ */
static const uint8_t PINS[CPG_JOINTS] = {@PINS@};
/* Measure these on the robot. CENTRE: angle of each servo where its joint is at 0 rad, degrees;
 * DIRECTION: 1 where the servo turns as the joint does, -1 where it turns the other way. */
static constexpr int16_t CENTRE[CPG_JOINTS] = {@CENTRES@};
static constexpr int16_t DIRECTION[CPG_JOINTS] = {@ONES@};

static constexpr bool all_within(const int16_t *values, int16_t high, int16_t low, int count)
{
    return count == 0 || (*values >= low && *values <= high
                          && all_within(values + 1, high, low, count - 1));
}
static_assert(all_within(CENTRE, 180, 0, CPG_JOINTS), "CENTRE: degrees from 0 to 180");
static_assert(all_within(DIRECTION, 1, -1, CPG_JOINTS), "DIRECTION: 1, or -1 to turn the other way");

static Servo servos[CPG_JOINTS];
static cpg gait;
static unsigned long next_tick;

static void write_servos()
{
    for (uint8_t joint = 0; joint < CPG_JOINTS; joint++) {
        const int tenths = CENTRE[joint] * 10
                         + DIRECTION[joint] * int(gait.position[joint] * 572.9578);
        servos[joint].write(tenths < 0 ? 0 : tenths > 1800 ? 180 : (tenths + 5) / 10);
    }
}

void setup()
{
    cpg_start(&gait, 0, 3);
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
        cpg_advance(&gait, cpg_real(TICK) / 1000);
        write_servos();
    }
}
