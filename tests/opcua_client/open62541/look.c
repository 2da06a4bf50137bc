/* A foreign client: every policy, mode, certificate and identity, and every service on each channel and in each session that
 * opens; then what a sound client does. One line of JSON for each. tests/system/test_opcua_matrix.py builds and starts it.
 * It needs open62541 1.5 with encryption and a static library, where pkg-config finds it, such as (in its sources)
 *   cmake -B build -DCMAKE_BUILD_TYPE=Release -DUA_ENABLE_ENCRYPTION=OPENSSL -DCMAKE_INSTALL_PREFIX=$HOME/open62541
 *   cmake --build build --target install
 *   export PKG_CONFIG_PATH=$HOME/open62541/lib/pkgconfig
 */
#include <open62541/client_config_default.h>
#include <open62541/client_highlevel.h>
#include <open62541/client_subscriptions.h>
#include <open62541/plugin/log_stdout.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Versions differ in the header that has it. */
void __UA_Client_Service(UA_Client *, const void *, const UA_DataType *, void *, const UA_DataType *);

#define URI "http://opcfoundation.org/UA/SecurityPolicy#"
#define NAME 256

static const char *POLICIES[] = {"None", "Basic128Rsa15", "Basic256", "Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss", "ECC_nistP256"};
static const char *KEYS[] = {"", "client", "stranger"};
static const char *IDENTITIES[] = {"right", "wrong password", "unknown user", "anonymous", "certificate"};
static const char *address, *folder, *user, *word;
static int changes, deleted;

static UA_ByteString file(const char *name, const char *ending) {
    char path[4 * NAME];
    snprintf(path, sizeof path, "%s/%s%s", folder, name, ending);
    FILE *from = fopen(path, "rb");
    if(!from) {
        fprintf(stderr, "%s is missing\n", path);
        exit(2);
    }
    fseek(from, 0, SEEK_END);
    UA_ByteString made;
    UA_ByteString_allocBuffer(&made, (size_t)ftell(from));
    rewind(from);
    if(fread(made.data, 1, made.length, from) != made.length) exit(2);
    fclose(from);
    return made;
}

/* A client with a certificate or none; it trusts the server by its file. */
static UA_Client *client_of(const char *key) {
    UA_Client *client = UA_Client_new();
    UA_ClientConfig *config = UA_Client_getConfig(client);
    if(!getenv("LOUD")) config->logging->log = NULL;
    UA_String_clear(&config->clientDescription.applicationUri);
    config->clientDescription.applicationUri = UA_STRING_ALLOC("urn:example:client");
    config->allowNonePolicyPassword = true;
    config->timeout = 15000;
    config->noReconnect = true;
    if(*key) {
        UA_ByteString certificate = file(key, ".der"), secret = file(key, ".pem"), server = file("server", ".der");
        UA_StatusCode made = UA_ClientConfig_setDefaultEncryption(config, certificate, secret, &server, 1, NULL, 0);
        if(made != UA_STATUSCODE_GOOD) fprintf(stderr, "no encryption: %s\n", UA_StatusCode_name(made));
        UA_ByteString_clear(&certificate);
        UA_ByteString_clear(&secret);
        UA_ByteString_clear(&server);
    }
    return client;
}

/* An endpoint as a hostile client wants it, whatever the server says it has. */
static void aim(UA_Client *client, const char *policy, UA_MessageSecurityMode mode, UA_UserTokenType token) {
    UA_ClientConfig *config = UA_Client_getConfig(client);
    char uri[NAME];
    snprintf(uri, sizeof uri, URI "%s", policy);
    config->endpoint.endpointUrl = UA_STRING_ALLOC(address);
    config->endpoint.server.applicationUri = UA_STRING_ALLOC("urn:gantryctl:server");
    config->endpoint.securityMode = mode;
    config->endpoint.securityPolicyUri = UA_STRING_ALLOC(uri);
    config->endpoint.transportProfileUri = UA_STRING_ALLOC("http://opcfoundation.org/UA-Profile/Transport/uatcp-uasc-uabinary");
    config->endpoint.serverCertificate = file("server", ".der");
    /* The library refuses by itself what the endpoint does not offer. */
    UA_UserTokenPolicy *offered = UA_UserTokenPolicy_new();
    offered->tokenType = token;
    offered->policyId = UA_STRING_ALLOC(
        token == UA_USERTOKENTYPE_USERNAME ? "username" : token == UA_USERTOKENTYPE_CERTIFICATE ? "certificate" : "anonymous");
    config->endpoint.userIdentityTokens = offered;
    config->endpoint.userIdentityTokensSize = 1;
    UA_UserTokenPolicy_copy(offered, &config->userTokenPolicy);
}

static UA_StatusCode enter(UA_Client *client, const char *identity) {
    if(!strcmp(identity, "right")) return UA_Client_connectUsername(client, address, user, word);
    if(!strcmp(identity, "wrong password")) return UA_Client_connectUsername(client, address, user, "wrong wrong wrong");
    if(!strcmp(identity, "unknown user")) return UA_Client_connectUsername(client, address, "nobody", word);
    if(!strcmp(identity, "certificate")) {
        UA_ByteString certificate = file("client", ".der"), secret = file("client", ".pem");
        UA_ClientConfig_setAuthenticationCert(UA_Client_getConfig(client), certificate, secret);
        UA_ByteString_clear(&certificate);
        UA_ByteString_clear(&secret);
    }
    return UA_Client_connect(client, address);
}

/* Every request that the library knows, with nothing in it. */
static void services(UA_Client *client) {
    const char *between = "";
    printf(",\"services\":{");
    for(size_t n = 0; n < UA_TYPES_COUNT; n++) {
        const UA_DataType *request = &UA_TYPES[n];
        size_t length = strlen(request->typeName);
        if(length < 8 || strcmp(request->typeName + length - 7, "Request") || request->membersSize == 0 ||
           request->members[0].memberType != &UA_TYPES[UA_TYPES_REQUESTHEADER])
            continue;
        char name[NAME], wanted[2 * NAME];
        snprintf(name, sizeof name, "%.*s", (int)(length - 7), request->typeName);
        snprintf(wanted, sizeof wanted, "%sResponse", name);
        /* They end what the others need; Publish is answered when there is something to publish. */
        if(!strcmp(name, "CloseSession") || !strcmp(name, "CloseSecureChannel") || !strcmp(name, "OpenSecureChannel")) continue;
        for(size_t m = 0; m < UA_TYPES_COUNT; m++) {
            if(strcmp(UA_TYPES[m].typeName, wanted)) continue;
            void *asked = UA_new(request), *answer = UA_new(&UA_TYPES[m]);
            __UA_Client_Service(client, asked, request, answer, &UA_TYPES[m]);
            printf("%s\"%s\":\"%s\"", between, name, UA_StatusCode_name(((UA_ResponseHeader *)answer)->serviceResult));
            between = ",";
            UA_delete(asked, request);
            UA_delete(answer, &UA_TYPES[m]);
        }
    }
    printf("}");
}

static void cell(const char *policy, UA_MessageSecurityMode mode, const char *key, const char *identity) {
    UA_UserTokenType token = !strcmp(identity, "anonymous") || !*identity ? UA_USERTOKENTYPE_ANONYMOUS
                             : !strcmp(identity, "certificate")           ? UA_USERTOKENTYPE_CERTIFICATE
                                                                          : UA_USERTOKENTYPE_USERNAME;
    UA_Client *client = client_of(key);
    aim(client, policy, mode, token);
    printf("{\"policy\":\"%s\",\"mode\":\"%s\",\"key\":\"%s\",\"identity\":\"%s\"", policy,
           mode == UA_MESSAGESECURITYMODE_NONE ? "None" : mode == UA_MESSAGESECURITYMODE_SIGN ? "Sign" : "SignAndEncrypt", key, identity);
    UA_StatusCode said;
    if(*identity) {
        said = enter(client, identity);
        printf(",\"session\":\"%s\"", UA_StatusCode_name(said));
    } else {
        said = UA_Client_connectSecureChannel(client, address);
        printf(",\"channel\":\"%s\"", UA_StatusCode_name(said));
    }
    if(said == UA_STATUSCODE_GOOD) services(client);
    printf("}\n");
    fflush(stdout);
    UA_Client_delete(client);
}

static void changed(UA_Client *client, UA_UInt32 subscription, void *context, UA_UInt32 item, void *of, UA_DataValue *value) {
    (void)client, (void)subscription, (void)context, (void)item, (void)of, (void)value;
    changes++;
}

static void gone(UA_Client *client, UA_UInt32 subscription, void *context) {
    (void)client, (void)subscription, (void)context;
    deleted++;
}

static int subscribe(UA_Client *client, UA_UInt16 space) {
    UA_CreateSubscriptionRequest wanted = UA_CreateSubscriptionRequest_default();
    wanted.requestedPublishingInterval = 200.0;
    UA_CreateSubscriptionResponse made = UA_Client_Subscriptions_create(client, wanted, NULL, NULL, gone);
    if(made.responseHeader.serviceResult != UA_STATUSCODE_GOOD) return 0;
    const char *names[] = {"Tags.scan", "Tags.pos_act_deg"};
    int good = 0;
    for(int n = 0; n < 2; n++) {
        UA_MonitoredItemCreateRequest item = UA_MonitoredItemCreateRequest_default(UA_NODEID_STRING(space, (char *)(uintptr_t)names[n]));
        UA_MonitoredItemCreateResult result =
            UA_Client_MonitoredItems_createDataChange(client, made.subscriptionId, UA_TIMESTAMPSTORETURN_BOTH, item, NULL, changed, NULL);
        good += result.statusCode == UA_STATUSCODE_GOOD;
    }
    return good == 2;
}

static double number(UA_Client *client, UA_NodeId node) {
    UA_Variant value;
    UA_Variant_init(&value);
    double found = NAN;
    if(UA_Client_readValueAttribute(client, node, &value) == UA_STATUSCODE_GOOD) {
        if(value.type == &UA_TYPES[UA_TYPES_DOUBLE]) found = *(UA_Double *)value.data;
        if(value.type == &UA_TYPES[UA_TYPES_UINT32]) found = *(UA_UInt32 *)value.data;
    }
    UA_Variant_clear(&value);
    return found;
}

/* A number in JSON, which has no NaN. */
static void print_number(const char *name, double value) {
    if(isfinite(value)) printf(",\"%s\":%g", name, value);
    else printf(",\"%s\":null", name);
}

/* References of a node, at most so many an answer; the rest by BrowseNext. */
static int browse(UA_Client *client, UA_NodeId node, UA_UInt32 most) {
    UA_BrowseDescription wanted;
    UA_BrowseDescription_init(&wanted);
    wanted.nodeId = node;
    wanted.resultMask = UA_BROWSERESULTMASK_ALL;
    wanted.referenceTypeId = UA_NODEID_NUMERIC(0, UA_NS0ID_HIERARCHICALREFERENCES);
    wanted.includeSubtypes = true;
    UA_BrowseResult found = UA_Client_browse(client, NULL, most, &wanted);
    int count = (int)found.referencesSize;
    while(found.continuationPoint.length > 0) {
        UA_BrowseResult more = UA_Client_browseNext(client, false, found.continuationPoint);
        UA_BrowseResult_clear(&found);
        found = more;
        count += (int)found.referencesSize;
    }
    UA_BrowseResult_clear(&found);
    return count;
}

/* As an application does it: the endpoint is chosen from those of the server; reads, a subscription, a lost connection. */
static void look(const char *policy) {
    UA_Client *client = client_of("client");
    UA_ClientConfig *config = UA_Client_getConfig(client);
    char uri[NAME];
    snprintf(uri, sizeof uri, URI "%s", policy);
    config->securityMode = UA_MESSAGESECURITYMODE_SIGNANDENCRYPT;
    config->securityPolicyUri = UA_STRING_ALLOC(uri);
    config->noReconnect = false;
    config->connectivityCheckInterval = 500;
    UA_StatusCode said = UA_Client_connectUsername(client, address, user, word);
    printf("{\"look\":\"%s\",\"session\":\"%s\"", policy, UA_StatusCode_name(said));
    UA_UInt16 space = 0;
    UA_Client_getNamespaceIndex(client, UA_STRING("urn:gantryctl:axis"), &space);
    UA_NodeId position = UA_NODEID_STRING(space, "Tags.pos_act_deg");
    print_number("position", number(client, position));
    print_number("limit_read", number(client, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_SERVERCAPABILITIES_OPERATIONLIMITS_MAXNODESPERREAD)));
    print_number("limit_browse", number(client, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_SERVERCAPABILITIES_OPERATIONLIMITS_MAXNODESPERBROWSE)));
    UA_RegisterNodesRequest wanted;
    UA_RegisterNodesRequest_init(&wanted);
    wanted.nodesToRegister = &position;
    wanted.nodesToRegisterSize = 1;
    UA_RegisterNodesResponse registered = UA_Client_Service_registerNodes(client, wanted);
    print_number("registered", registered.registeredNodeIdsSize == 1 ? number(client, registered.registeredNodeIds[0]) : NAN);
    UA_RegisterNodesResponse_clear(&registered);
    printf(",\"references\":%d", browse(client, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER), 0));
    printf(",\"references_in_threes\":%d", browse(client, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER), 3));
    UA_Variant value;
    UA_Double one = 1.0;
    UA_Variant_setScalar(&value, &one, &UA_TYPES[UA_TYPES_DOUBLE]);
    printf(",\"write\":\"%s\"", UA_StatusCode_name(UA_Client_writeValueAttribute(client, position, &value)));
    size_t count = 0;
    UA_Variant *results = NULL;
    said = UA_Client_call(client, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER), UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_GETMONITOREDITEMS), 0, NULL, &count, &results);
    printf(",\"call\":\"%s\"", UA_StatusCode_name(said));
    int good = subscribe(client, space);
    for(int n = 0; n < 300 && changes <= 4; n++) UA_Client_run_iterate(client, 100);
    printf(",\"changes\":%s}\n{\"cut\":true}\n", good && changes > 4 ? "true" : "false");
    fflush(stdout);
    char line[NAME];
    if(!fgets(line, sizeof line, stdin)) exit(2);
    changes = 0;
    int before = deleted, again = 0;
    for(int n = 0; n < 300 && changes <= 4; n++) {
        UA_SessionState session;
        /* What is returned while there is no connection is no end: the next turn opens one. */
        said = UA_Client_run_iterate(client, 100);
        UA_Client_getState(client, NULL, &session, NULL);
        /* The session of the lost connection is over, and what it had; the library says so, and the application begins anew. */
        if(deleted > before && !again && session == UA_SESSIONSTATE_ACTIVATED) again = subscribe(client, space);
    }
    printf("{\"after\":\"%s\",\"subscriptions_ended\":%d,\"changes_after_cut\":%s,\"last\":\"%s\"}\n", policy, deleted - before, changes > 4 ? "true" : "false", UA_StatusCode_name(said));
    fflush(stdout);
    changes = 0;
    UA_Client_disconnect(client);
    UA_Client_delete(client);
}

int main(int count, char **arguments) {
    if(count != 5) return 2;
    address = arguments[1], folder = arguments[2], user = arguments[3], word = arguments[4];
    printf("{\"version\":\"open62541 " UA_OPEN62541_VERSION "\"}\n");
    for(size_t p = 0; p < sizeof POLICIES / sizeof *POLICIES; p++) {
        int plain = !strcmp(POLICIES[p], "None");
        for(int m = 0; m < (plain ? 1 : 2); m++) {
            UA_MessageSecurityMode mode = plain ? UA_MESSAGESECURITYMODE_NONE : m ? UA_MESSAGESECURITYMODE_SIGN : UA_MESSAGESECURITYMODE_SIGNANDENCRYPT;
            for(size_t k = 0; k < 3; k++) {
                cell(POLICIES[p], mode, KEYS[k], "");
                for(size_t i = 0; i < 5; i++) cell(POLICIES[p], mode, KEYS[k], IDENTITIES[i]);
            }
        }
    }
    look("Basic256Sha256");
    look("Aes128_Sha256_RsaOaep");
    look("Aes256_Sha256_RsaPss");
    return 0;
}
