using Nep;

// Listing 9 of the paper: publish one message and exit.
namespace Example
{
    class Program
    {
        class Msg
        {
            public string message { get; set; }
        }

        static void Main(string[] args)
        {
            Nep.Node node = new Nep.Node("csharp_sender");
            Nep.Publisher pub = node.new_pub("test", "json");
            Msg msg = new Msg();
            msg.message = "hello";
            pub.publish(msg);
        }
    }
}
