"""A network fitted to a recorded gait: parameters, readouts, and how sure they are.

Imports ``gaits``, ``motion`` and what is below; knows nothing of ROS.
"""

__all__ = ['caveats', 'coordinates', 'cycle_fit', 'fit_data', 'fit_figures', 'fit_report',
           'free_parameters', 'gait_fit', 'given_up', 'identifiability', 'invert', 'least_squares',
           'model_choice', 'paper_fit', 'parameter_files', 'recording_fit', 'trust_region',
           'variable_projection', 'waveform_harmonics']
