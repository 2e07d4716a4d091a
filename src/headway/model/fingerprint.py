from headway.models.fingerprint import *  # temporary
