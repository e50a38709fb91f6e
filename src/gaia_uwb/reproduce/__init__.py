"""Every table and figure of the paper, from nothing but the package and the data.

``plan``         what is compared, with how many models, at full size and as a quick run
``trainings``    models: trained where missing or stale, several at a time (``jobs``)
``predictions``  what each method makes of each episode, kept in files apart from all scores
``scores``       means with intervals, and paired differences, always from the predictions
``outdoor``      table 1, and what each part of the alignment is worth
``stress_test``  table 2 and the ablations
``robustness``   table 4
``simulator_table``  table 5
``figures``      all figures
``workshop``     what a part needs: folder, plan, data, and who is told
``parts``        one function per part; results.json
``page``         the page of results
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
