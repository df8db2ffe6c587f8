"""What a robot feels, brought back to its pattern: kinematics, estimate, laws, efference copy.

Imports ``motion``, ``robots`` and what is below; knows nothing of ROS. All of it works on many
robots at a time: arrays have a leading axis of runs, which is 1 for a robot alone.
"""

__all__ = ['efference_copy', 'estimate', 'feedback', 'foot_force', 'gains', 'gait_tables',
           'heading', 'kinematics', 'pace', 'placement', 'plausibility', 'posture',
           'precompile', 'reflexes', 'sidestep', 'slope', 'speed', 'tegotae', 'tick',
           'timetable', 'touchdown', 'watch']
