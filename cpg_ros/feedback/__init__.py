"""What a robot feels, brought back to its pattern: kinematics, estimate, laws, efference copy.

Imports ``motion``, ``robots`` and what is below; knows nothing of ROS. All of it works on many
robots at a time: arrays have a leading axis of runs, which is 1 for a robot alone. So far it
closes loops in process, in ``simulation``; no node uses it.
"""

__all__ = ['efference_copy', 'estimate', 'feedback', 'gains', 'heading', 'kinematics', 'pace',
           'placement', 'posture', 'reflexes', 'slope', 'speed', 'timetable']
