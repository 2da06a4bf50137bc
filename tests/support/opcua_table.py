"""What the OPC UA server allows: the table that raw and foreign clients are judged by."""

from __future__ import annotations

from asyncua import ua

from support.opcua_bench import PASSWORD
from support.opcua_wire import password, requests

SECURE = ("Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss")
POLICIES = ("None", "Basic128Rsa15", "Basic256", *SECURE, "ECC_nistP256")
IDENTITIES = {
    "right": ("Good", lambda: password("viewer", PASSWORD)),
    "wrong password": ("BadUserAccessDenied", lambda: password("viewer", "wrong wrong wrong")),
    "unknown user": ("BadUserAccessDenied", lambda: password("nobody", PASSWORD)),
    "anonymous": ("BadIdentityTokenRejected", lambda: ua.AnonymousIdentityToken("anonymous")),
    "certificate": ("BadIdentityTokenRejected", lambda: ua.X509IdentityToken("certificate", b"0")),
}
DISCOVERY = {"FindServers", "GetEndpoints"}
READING = {
    "Read", "Browse", "TranslateBrowsePathsToNodeIds", "RegisterNodes", "UnregisterNodes", "CreateSubscription",
    "DeleteSubscriptions", "SetPublishingMode", "Publish",
}  # fmt: skip
# They name no subscription here, so that is what is wrong with them.
NO_SUBSCRIPTION = {
    "ModifySubscription", "CreateMonitoredItems", "ModifyMonitoredItems", "DeleteMonitoredItems",
    "SetMonitoringMode", "Republish",
}  # fmt: skip
CHANGES = {"Write", "Call", "HistoryUpdate", "AddNodes", "DeleteNodes", "AddReferences", "DeleteReferences"}
ALL = requests()
NOT_THERE = set(ALL) - {
    *DISCOVERY, *READING, *NO_SUBSCRIPTION, *CHANGES, "CreateSession", "ActivateSession", "CloseSession",
}  # fmt: skip


def status_of(service: str, state: str) -> str:
    """What the table allows: `state` is "none" (a channel without security), open, created or active."""
    if service in DISCOVERY:
        return "Good"
    if state == "none":
        return "BadSecurityPolicyRejected"
    if service == "CreateSession":
        return "BadCertificateInvalid"  # this one carries none
    if state == "open":
        return "BadSessionIdInvalid"
    if service == "ActivateSession":
        return "BadIdentityTokenRejected"  # this one carries none
    if state == "created":
        return "BadSessionNotActivated"
    if service in CHANGES:
        return "BadUserAccessDenied"
    if service in NOT_THERE:
        return "BadServiceUnsupported"
    return "BadSubscriptionIdInvalid" if service in NO_SUBSCRIPTION else "Good"


def opens(policy: str, mode: str, key: str) -> bool:
    """Whether a channel opens; `mode` is None, Sign or SignAndEncrypt, `key` the client's certificate."""
    return (policy, mode) == ("None", "None") or (
        policy in SECURE and mode == "SignAndEncrypt" and key == "client"
    )
