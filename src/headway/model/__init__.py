from headway.models import *  # temporary
