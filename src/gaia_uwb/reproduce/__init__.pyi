from .figures import FOLDER as FOLDER
from .formats import QUICK_MARK as QUICK_MARK
from .jobs import n_cores as n_cores
from .page import page_images as page_images, results_page as results_page
from .parts import read_results as read_results, run_all as run_all, run_part as run_part
from .plan import QUICK as QUICK, Plan as Plan
from .workshop import OUTDOOR as OUTDOOR, Workshop as Workshop
